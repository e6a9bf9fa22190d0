// Depth order: a stable radix sort of depth keys, least significant digit first, RADIX_BITS at a time.
//
// The keys are cut into `chunks` contiguous parts, one work-item each:
//   count_digits    histogram of its part's digits
//   scan_chunks     (counting.cl), then prefix sums over the digits on the host
//   scatter_digits  move keys and positions to their places
// Keys are in storage order, by *position*. The first pass (FIRST_PASS 1) reads them in row order and drops invisible
// Gaussians, so equal depths end up in row order.

#define DIGIT(key) ((key) >> shift & ((1u << RADIX_BITS) - 1))

__kernel void count_digits(uint count, uint chunks, uint shift,
                           __global const uint *keys,       // [K], then [V]
                           __global const uint *positions,  // [K], then [V]
                           __global uint *row_keys,         // [K]
                           __global uint *histogram) {      // [chunks,1 << RADIX_BITS]
    uint chunk = get_global_id(0);
    if (chunk >= chunks) return;
    uint size = (count + chunks - 1) / chunks, begin = min(chunk * size, count), end = min(begin + size, count);
    __global uint *h = histogram + (chunk << RADIX_BITS);
    for (uint digit = 0; digit < 1u << RADIX_BITS; digit++) h[digit] = 0;
    for (uint i = begin; i < end; i++) {
#if FIRST_PASS
        uint key = row_keys[i] = keys[positions[i]];
#else
        uint key = keys[i];
#endif
        if (key != NOT_VISIBLE) h[DIGIT(key)]++;
    }
}

__kernel void scatter_digits(uint count, uint chunks, uint shift,
                             __global const uint *keys,          // [K], then [V]
                             __global const uint *positions,     // [K], then [V]
                             __global uint *histogram,           // [chunks,1 << RADIX_BITS]
                             __global const uint *digit_starts,  // [(1 << RADIX_BITS) + 1]
                             __global uint *sorted_keys,         // [V]
                             __global uint *sorted_positions) {  // [V]
    uint chunk = get_global_id(0);
    if (chunk >= chunks) return;
    uint size = (count + chunks - 1) / chunks, begin = min(chunk * size, count), end = min(begin + size, count);
    __global uint *h = histogram + (chunk << RADIX_BITS);
    for (uint i = begin; i < end; i++) {
        uint key = keys[i];
        if (key == NOT_VISIBLE) continue;
        uint place = digit_starts[DIGIT(key)] + h[DIGIT(key)]++;
        sorted_keys[place] = key;
        sorted_positions[place] = positions[i];
    }
}
