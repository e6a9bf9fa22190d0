// Depth order: a stable radix sort of depth keys, least significant digit first, RADIX_BITS at a time.
//
// The keys are cut into `chunks` contiguous parts, one work-item each:
//   count_digits    histogram of its part's digits
//   scan_chunks, scan_totals  (counting.cl)
//   scatter_digits  move pairs of a key and a position to their places: one stream of writes per digit
//   order_ties      after the last digit: positions without keys; those of equal keys into row order
// Keys are in storage order, by *position*. The first pass (FIRST_PASS 1) drops invisible Gaussians; later ones find the
// number of the others behind the starts of the digits.

#define DIGITS (1u << RADIX_BITS)
#define DIGIT(key) ((key) >> shift & (DIGITS - 1))
#if FIRST_PASS
#define LENGTH count
#define ITEMS const uint
#define KEY(item) (item)
#define PAIR(i) ((ulong)items[i] << 32 | (i))
#else
#define LENGTH digit_starts[DIGITS]
#define ITEMS const ulong
#define KEY(item) ((uint)((item) >> 32))
#define PAIR(i) items[i]
#endif
#define CHUNK_OF_ITEMS                                                         \
    uint chunk = get_global_id(0);                                             \
    if (chunk >= chunks) return;                                               \
    uint length = LENGTH, size = (length + chunks - 1) / chunks;               \
    uint begin = min(chunk * size, length), end = min(begin + size, length);

__kernel void count_digits(uint count, uint chunks, uint shift,
                           __global const uint *digit_starts,  // [DIGITS+1], of the pass before
                           __global ITEMS *items,              // keys [K], then pairs [V]
                           __global uint *histogram) {         // [chunks,DIGITS]
    CHUNK_OF_ITEMS
    __global uint *h = histogram + chunk * DIGITS;
    for (uint digit = 0; digit < DIGITS; digit++) h[digit] = 0;
    for (uint i = begin; i < end; i++) {
        uint key = KEY(items[i]);
        if (key != NOT_VISIBLE) h[DIGIT(key)]++;
    }
}

__kernel void scatter_digits(uint count, uint chunks, uint shift,
                             __global const uint *digit_starts,  // [DIGITS+1]
                             __global ITEMS *items,              // keys [K], then pairs [V]
                             __global uint *histogram,           // [chunks,DIGITS]
                             __global ulong *pairs) {            // [V], sorted
    CHUNK_OF_ITEMS
    __global uint *h = histogram + chunk * DIGITS;
    for (uint i = begin; i < end; i++) {
        uint key = KEY(items[i]);
        if (key != NOT_VISIBLE) pairs[digit_starts[DIGIT(key)] + h[DIGIT(key)]++] = PAIR(i);
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
                         __global const ulong *items,        // [V], sorted by key
                         __global const uint *rows,          // [K]
                         __global uint *positions) {         // [V]
    CHUNK_OF_ITEMS
    while (begin > 0 && begin < end && KEY(items[begin]) == KEY(items[begin - 1])) begin++;  // ties of an earlier chunk
    while (begin < end) {
        uint first = begin;
        do positions[begin] = (uint)items[begin];
        while (++begin < length && KEY(items[begin]) == KEY(items[first]));
        if (begin - first > 1) sort_by_row(rows, positions + first, begin - first);
    }
}
#endif
