// A stable radix sort of pairs (key << 32 | value), 8 bits a pass, for devices with many small cores; and running sums.
//
// A work-group of SORT_GROUP work-items sorts a tile of SORT_TILE pairs:
//   count_digits    histogram of each tile's digits
//   scan_digits     each digit's count becomes a sum over the tiles before; a total per digit
//   scatter_pairs   sort the tile in local memory by two splits of 4 bits, then write runs of equal digits to their places
// The number of pairs is read from the device: `length` is no more than the number that the launch was sized for.

#define EACH (SORT_TILE / SORT_GROUP)  // pairs of a work-item
#define KEY(pair) ((uint)((pair) >> 32))
#define DIGIT(pair) (KEY(pair) >> shift & 255u)
#define NIBBLE(pair) (KEY(pair) >> shift & 15u)

// The inclusive sum of `value` over the work-items of the group.
inline uint group_sum(__local uint *sums, uint value) {
    uint item = get_local_id(0);
    sums[item] = value;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint step = 1; step < SORT_GROUP; step *= 2) {
        uint before = item >= step ? sums[item - step] : 0;
        barrier(CLK_LOCAL_MEM_FENCE);
        sums[item] += before;
        barrier(CLK_LOCAL_MEM_FENCE);
    }
    uint sum = sums[item];
    barrier(CLK_LOCAL_MEM_FENCE);
    return sum;
}

__kernel void count_digits(uint tiles, uint shift,
                           __global const uint *length,  // [1]
                           __global const ulong *pairs,  // [length]
                           __global uint *counts) {      // [256,tiles]
    __local uint histogram[256];
    uint item = get_local_id(0), tile = get_group_id(0), end = min((tile + 1) * SORT_TILE, length[0]);
    histogram[item] = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint i = tile * SORT_TILE + item; i < end; i += SORT_GROUP) atomic_inc(&histogram[DIGIT(pairs[i])]);
    barrier(CLK_LOCAL_MEM_FENCE);
    counts[item * tiles + tile] = histogram[item];
}

// One work-group per digit.
__kernel void scan_digits(uint tiles,
                          __global uint *counts,    // [256,tiles]
                          __global uint *totals) {  // [256]
    __local uint sums[SORT_GROUP];
    uint item = get_local_id(0), run = (tiles + SORT_GROUP - 1) / SORT_GROUP, own = 0;
    uint begin = min(item * run, tiles), end = min(begin + run, tiles);
    __global uint *row = counts + (size_t)get_group_id(0) * tiles;
    for (uint tile = begin; tile < end; tile++) own += row[tile];
    uint sum = group_sum(sums, own);
    if (item == SORT_GROUP - 1) totals[get_group_id(0)] = sum;
    sum -= own;
    for (uint tile = begin; tile < end; tile++) {
        uint count = row[tile];
        row[tile] = sum;
        sum += count;
    }
}

// Splits a tile by 4 bits, stable: a work-item holds EACH consecutive pairs.
inline void split(__local ulong *pairs, __local ushort *counters, __local uint *sums, uint shift) {
    uint item = get_local_id(0), own = 0;
    ulong mine[EACH];
    for (uint nibble = 0; nibble < 16; nibble++) counters[nibble * SORT_GROUP + item] = 0;
    for (uint i = 0; i < EACH; i++) {
        mine[i] = pairs[item * EACH + i];
        counters[NIBBLE(mine[i]) * SORT_GROUP + item]++;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint i = 0; i < 16; i++) own += counters[item * 16 + i];
    uint before = group_sum(sums, own) - own;
    for (uint i = 0; i < 16; i++) {
        uint count = counters[item * 16 + i];
        counters[item * 16 + i] = before;
        before += count;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint i = 0; i < EACH; i++) pairs[counters[NIBBLE(mine[i]) * SORT_GROUP + item]++] = mine[i];
    barrier(CLK_LOCAL_MEM_FENCE);
}

__kernel void scatter_pairs(uint tiles, uint shift,
                            __global const uint *length,  // [1]
                            __global const ulong *pairs,  // [length]
                            __global const uint *counts,  // [256,tiles], scanned
                            __global const uint *totals,  // [256]
                            __global ulong *sorted) {     // [length]
    __local ulong tile_pairs[SORT_TILE];
    __local ushort counters[16 * SORT_GROUP];
    __local uint sums[SORT_GROUP], first[256];
    __local int offset[256];
    uint item = get_local_id(0), tile = get_group_id(0), begin = tile * SORT_TILE, all = length[0];
    if (begin >= all) return;  // the whole group
    uint size = min((uint)SORT_TILE, all - begin);
    for (uint i = item; i < SORT_TILE; i += SORT_GROUP) tile_pairs[i] = i < size ? pairs[begin + i] : (ulong)-1;  // ends up behind
    first[item] = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    split(tile_pairs, counters, sums, shift);
    split(tile_pairs, counters, sums, shift + 4);
    for (uint i = item; i < size; i += SORT_GROUP)
        if (i == 0 || DIGIT(tile_pairs[i]) != DIGIT(tile_pairs[i - 1])) first[DIGIT(tile_pairs[i])] = i;
    uint total = totals[item];
    uint start = group_sum(sums, total) - total;  // of the digit among all pairs
    offset[item] = (int)(start + counts[item * tiles + tile]) - (int)first[item];
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint i = item; i < size; i += SORT_GROUP) sorted[offset[DIGIT(tile_pairs[i])] + (int)i] = tile_pairs[i];
}

// Running sums of a tile, before each value; and the sum of the tile.
__kernel void sum_tiles(uint count,
                        __global uint *values,  // [count]
                        __global uint *sums) {  // [tiles]
    __local uint shared[SORT_GROUP];
    uint item = get_local_id(0), begin = get_group_id(0) * SORT_TILE + item * EACH, own = 0;
    uint end = min(begin + EACH, count);
    for (uint i = begin; i < end; i++) own += values[i];
    uint sum = group_sum(shared, own);
    if (item == SORT_GROUP - 1) sums[get_group_id(0)] = sum;
    sum -= own;
    for (uint i = begin; i < end; i++) {
        uint value = values[i];
        values[i] = sum;
        sum += value;
    }
}

// Adds the sums of the tiles before; the sum of all values ends up behind them.
__kernel void add_tile_sums(uint count, uint tiles,
                            __global const uint *starts,  // [tiles+1], running sums of the tiles
                            __global uint *values) {      // [count+1]
    uint i = get_global_id(0);
    if (i < count) values[i] += starts[i / SORT_TILE];
    if (i == count) values[i] = starts[tiles];
}
