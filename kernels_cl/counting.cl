// The common step of the stable counting sorts: each bin of a histogram becomes an exclusive sum over the chunks, and a
// total. With prefix sums over the totals, every chunk then has the place of its next item of each bin.
//
// A work-item handles SCAN_BINS bins.

__kernel void scan_chunks(uint chunks, uint bins,
                          __global uint *histogram,  // [chunks,bins]
                          __global uint *totals) {   // [bins]
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
