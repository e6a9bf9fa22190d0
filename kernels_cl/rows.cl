// Values in storage order and blocks (vector.cl), one row after the other in the order of the model, and back: `attributes` of
// them, from the `first` on, of `all` in a block. A work-item handles a block.

__kernel void by_row(uint count, uint attributes, uint first, uint all,
                     __global const float *blocks,  // [blocks,all,BLOCK]
                     __global const uint *rows,     // [K], the row at each position
                     __global float *values) {      // [K,attributes]
    uint begin = get_global_id(0) * BLOCK, end = min(begin + BLOCK, count);
    for (uint position = begin; position < end; position++) {
        __global const float *in = blocks + (size_t)begin * all + first * BLOCK + position - begin;
        __global float *out = values + (size_t)rows[position] * attributes;
        for (uint i = 0; i < attributes; i++) out[i] = in[i * BLOCK];
    }
}

// The storage order is that of the rows.
__kernel void into_blocks(uint count, uint attributes, uint first, uint all,
                          __global const float *values,  // [K,attributes]
                          __global float *blocks) {      // [blocks,all,BLOCK], padded with zeros
    uint begin = get_global_id(0) * BLOCK;
    if (begin >= max(count, 1u)) return;
    __global const float *in = values + (size_t)begin * attributes;
    __global float *out = blocks + (size_t)begin * all + first * BLOCK;
    for (uint i = 0; i < attributes; i++) {
        if (begin + BLOCK <= count) {
#define IN(lane) in[i + (lane) * attributes]
            vstore16((float16)(IN(0), IN(1), IN(2), IN(3), IN(4), IN(5), IN(6), IN(7), IN(8), IN(9), IN(10), IN(11), IN(12),
                               IN(13), IN(14), IN(15)),
                     i, out);
        } else {
            for (uint lane = 0; lane < BLOCK; lane++)
                out[i * BLOCK + lane] = begin + lane < count ? IN(lane) : 0.0f;
        }
    }
}
