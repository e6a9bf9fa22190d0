// The common steps of the stable counting sorts: the next item of a bin in a chunk goes to the bin's first place plus the
// chunk's offset in the bin.

// Each bin of a histogram becomes an exclusive sum over the chunks, and a total. A work-group handles SCAN_BINS bins.
__kernel void scan_chunks(uint chunks, uint bins,
                          __global uint *histogram,  // [chunks,bins]
                          __global uint *totals) {   // [bins]
    uint begin = get_group_id(0) * SCAN_BINS, end = min(begin + SCAN_BINS, bins);
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

// The first place of each bin, and behind the last one the number of items. One work-group handles all, a run of bins per
// work-item.
__kernel void scan_totals(uint bins,
                          __global const uint *totals,  // [bins]
                          __global uint *starts) {      // [bins+1]
    __local uint sums[SCAN_ITEMS];
    uint item = get_local_id(0), run = (bins + SCAN_ITEMS - 1) / SCAN_ITEMS, sum = 0;
    uint begin = min(item * run, bins), end = min(begin + run, bins);
    for (uint bin = begin; bin < end; bin++) sum += totals[bin];
    sums[item] = sum;
    barrier(CLK_LOCAL_MEM_FENCE);
    sum = 0;
    for (uint earlier = 0; earlier < item; earlier++) sum += sums[earlier];
    for (uint bin = begin; bin < end; bin++) {
        starts[bin] = sum;
        sum += totals[bin];
    }
    if (item == SCAN_ITEMS - 1) starts[bins] = sum;
}
