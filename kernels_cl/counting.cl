// The step that stable counting sorts share: a histogram [chunks][bins] becomes, bin by bin, exclusive sums over the
// chunks, and totals [bins]. With prefix sums over the totals, every chunk then knows where its next item of a bin goes.

__kernel void scan_chunks(uint chunks, uint bins, __global uint *histogram, __global uint *totals) {
    uint begin = get_global_id(0) * SCAN_BINS, end = min(begin + SCAN_BINS, bins);
    if (begin >= end) return;
    uint sums[SCAN_BINS];
    for (uint i = 0; i < SCAN_BINS; i++) sums[i] = 0;
    for (uint chunk = 0; chunk < chunks; chunk++) {
        __global uint *h = histogram + (size_t)chunk * bins;
        for (uint bin = begin; bin < end; bin++) {
            uint count = h[bin];
            h[bin] = sums[bin - begin];
            sums[bin - begin] += count;
        }
    }
    for (uint bin = begin; bin < end; bin++) totals[bin] = sums[bin - begin];
}
