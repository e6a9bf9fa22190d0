// Depth order: a stable radix sort of depth keys, least significant digit first, RADIX_BITS at a time.
//
// The keys are cut into `chunks` contiguous parts, one work-item each:
//   count_digits    histogram of its part's digits
//   scan_chunks, scan_totals  (counting.cl)
//   scatter_digits  move keys and positions to their places
//   order_ties      after the last digit: equal keys, in storage order so far, into row order
// Keys are in storage order, by *position*. The first pass (FIRST_PASS 1) drops invisible Gaussians; later ones find the
// number of the others behind the starts of the digits.

#define DIGITS (1u << RADIX_BITS)
#define DIGIT(key) ((key) >> shift & (DIGITS - 1))
#if FIRST_PASS
#define LENGTH count
#define POSITION(i) (i)
#else
#define LENGTH digit_starts[DIGITS]
#define POSITION(i) positions[i]
#endif
#define CHUNK_OF_KEYS                                                          \
    uint chunk = get_global_id(0);                                             \
    if (chunk >= chunks) return;                                               \
    uint length = LENGTH, size = (length + chunks - 1) / chunks;               \
    uint begin = min(chunk * size, length), end = min(begin + size, length);

__kernel void count_digits(uint count, uint chunks, uint shift,
                           __global const uint *digit_starts,  // [DIGITS+1], of the pass before
                           __global const uint *keys,          // [K], then [V]
                           __global uint *histogram) {         // [chunks,DIGITS]
    CHUNK_OF_KEYS
    __global uint *h = histogram + chunk * DIGITS;
    for (uint digit = 0; digit < DIGITS; digit++) h[digit] = 0;
    for (uint i = begin; i < end; i++) {
        uint key = keys[i];
        if (key != NOT_VISIBLE) h[DIGIT(key)]++;
    }
}

__kernel void scatter_digits(uint count, uint chunks, uint shift,
                             __global const uint *digit_starts,  // [DIGITS+1]
                             __global const uint *keys,          // [K], then [V]
                             __global const uint *positions,     // [V], not for the first pass
                             __global uint *histogram,           // [chunks,DIGITS]
                             __global uint *sorted_keys,         // [V]
                             __global uint *sorted_positions) {  // [V]
    CHUNK_OF_KEYS
    __global uint *h = histogram + chunk * DIGITS;
    for (uint digit = 0; digit < DIGITS; digit++) h[digit] += digit_starts[digit];
    for (uint i = begin; i < end; i++) {
        uint key = keys[i];
        if (key == NOT_VISIBLE) continue;
        uint place = h[DIGIT(key)]++;
        sorted_keys[place] = key;
        sorted_positions[place] = POSITION(i);
    }
}

#if !FIRST_PASS
// Shell's sort, since a plane that faces the camera has one depth.
inline void sort_by_row(__global const uint *rows, __global uint *positions, uint length) {
    uint gap = 1;
    while (gap < length / 3) gap = 3 * gap + 1;
    for (; gap > 0; gap /= 3)
        for (uint i = gap; i < length; i++) {
            uint position = positions[i], row = rows[position], place = i;
            for (; place >= gap && rows[positions[place - gap]] > row; place -= gap) positions[place] = positions[place - gap];
            positions[place] = position;
        }
}

__kernel void order_ties(uint count, uint chunks,
                         __global const uint *digit_starts,  // [DIGITS+1]
                         __global const uint *keys,          // [V], sorted
                         __global const uint *rows,          // [K]
                         __global uint *positions) {         // [V]
    CHUNK_OF_KEYS
    while (begin > 0 && begin < end && keys[begin] == keys[begin - 1]) begin++;  // ties that an earlier chunk orders
    while (begin < end) {
        uint first = begin++;
        while (begin < length && keys[begin] == keys[first]) begin++;
        if (begin - first > 1) sort_by_row(rows, positions + first, begin - first);
    }
}
#endif
