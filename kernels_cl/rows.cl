// Values in storage order and blocks (vector.cl), one row after the other in the order of the model, and back. A work-item
// handles a block.

__kernel void by_row(uint count, uint attributes,
                     __global const float *blocks,  // [blocks,attributes,BLOCK]
                     __global const uint *rows,     // [K], the row at each position
                     __global float *values) {      // [K,attributes]
    uint begin = get_global_id(0) * BLOCK, end = min(begin + BLOCK, count);
    for (uint position = begin; position < end; position++) {
        __global const float *in = blocks + (size_t)begin * attributes + position - begin;
        __global float *out = values + (size_t)rows[position] * attributes;
        for (uint i = 0; i < attributes; i++) out[i] = in[i * BLOCK];
    }
}

__kernel void by_position(uint count, uint attributes,
                          __global const float *values,  // [K,attributes]
                          __global const uint *rows,     // [K], the row at each position
                          __global float *blocks) {      // [blocks,attributes,BLOCK], padded with zeros
    uint begin = get_global_id(0) * BLOCK;
    if (begin >= max(count, 1u)) return;
    __global float *out = blocks + (size_t)begin * attributes;
    for (uint lane = 0; lane < BLOCK; lane++) {
        bool stored = begin + lane < count;
        __global const float *in = values + (size_t)(stored ? rows[begin + lane] : 0) * attributes;
        for (uint i = 0; i < attributes; i++) out[i * BLOCK + lane] = stored ? in[i] : 0.0f;
    }
}
