// Pairs (key << 32 | value) of the radix sort (sorting.cl): depth and position of a Gaussian, tile and slot of an entry.

__kernel void pair_keys(uint count,
                        __global const uint *places,      // [K], the position of each row
                        __global const uint *depth_keys,  // [K], by position
                        __global ulong *pairs,            // [K], in row order
                        __global uint *counts) {          // [2], all and visible
    uint row = get_global_id(0);
    if (row == 0) counts[0] = count;
    if (row < count) pairs[row] = (ulong)depth_keys[places[row]] << 32 | places[row];
}

__kernel void take_positions(uint count,
                             __global const ulong *pairs,  // [K], sorted by key
                             __global uint *positions,     // [V]
                             __global uint *counts) {      // [2], all and visible
    uint i = get_global_id(0);
    if (i >= count) return;
    bool visible = (uint)(pairs[i] >> 32) != NOT_VISIBLE;
    positions[i] = (uint)pairs[i];
    if (visible && (i == count - 1 || (uint)(pairs[i + 1] >> 32) == NOT_VISIBLE)) counts[1] = i + 1;
    if (!visible && i == 0) counts[1] = 0;
}

// The entries of each tile begin at its first pair.
__kernel void find_tile_starts(uint tiles,
                               __global const uint *length,  // [1]
                               __global const ulong *pairs,  // [length], tile << 32 | slot, sorted
                               __global uint *tile_starts) { // [tiles+1]
    uint tile = get_global_id(0);
    if (tile > tiles) return;
    uint low = 0, high = length[0];
    while (low < high) {
        uint middle = low + (high - low) / 2;
        if ((uint)(pairs[middle] >> 32) < tile) low = middle + 1;
        else high = middle;
    }
    tile_starts[tile] = low;
}

__kernel void place_entries(__global const uint *length,          // [1]
                            __global const ulong *pairs,          // [length], tile << 32 | slot, sorted
                            __global const uint *slot_positions,  // [length]
                            __global uint2 *entries) {            // [length], (position, slot)
    uint i = get_global_id(0);
    if (i < length[0]) entries[i] = (uint2)(slot_positions[(uint)pairs[i]], (uint)pairs[i]);
}
