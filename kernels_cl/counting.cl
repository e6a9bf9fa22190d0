// The common steps of the stable counting sorts. With both, every chunk has the place of its next item of each bin.

// Each bin of a histogram becomes an exclusive sum over the chunks, and a total. A work-item handles SCAN_BINS bins.
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

// The first place of each bin, and behind the last one the number of items. One work-item handles all.
__kernel void scan_totals(uint bins,
                          __global const uint *totals,  // [bins]
                          __global uint *starts) {      // [bins+1]
    if (get_global_id(0) > 0) return;
    uint sum = 0;
    for (uint bin = 0; bin < bins; bin++) {
        starts[bin] = sum;
        sum += totals[bin];
    }
    starts[bins] = sum;
}
