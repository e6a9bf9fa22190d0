// Copies between blocks [blocks,all,BLOCK] in storage order (vector.cl) and arrays [K,attributes]: `attributes` of the `all`
// that a block holds, from the `first` on. `by_row` also restores the model's order of rows; `into_blocks` takes rows in storage
// order. A work-item handles a block.

#if LANES == 16
// Exchange lines and columns of a whole block of 16 attributes: each round interleaves its upper and its lower half.
inline void transpose(float16 *lines) {
#pragma unroll
    for (int round = 0; round < 4; round++) {
        float16 mixed[16];
#pragma unroll
        for (int i = 0; i < 8; i++) {
            float16 a = lines[i], b = lines[i + 8];
            mixed[2 * i] = (float16)(a.s0, b.s0, a.s1, b.s1, a.s2, b.s2, a.s3, b.s3, a.s4, b.s4, a.s5, b.s5, a.s6, b.s6,
                                     a.s7, b.s7);
            mixed[2 * i + 1] = (float16)(a.s8, b.s8, a.s9, b.s9, a.sa, b.sa, a.sb, b.sb, a.sc, b.sc, a.sd, b.sd, a.se,
                                         b.se, a.sf, b.sf);
        }
#pragma unroll
        for (int i = 0; i < 16; i++) lines[i] = mixed[i];
    }
}
#endif

__kernel void by_row(uint count, uint attributes, uint first, uint all,
                     __global const float *blocks,  // [blocks,all,BLOCK]
                     __global const uint *rows,     // [K], the row at each position
                     __global float *values) {      // [K,attributes]
    uint begin = get_global_id(0) * BLOCK;
    if (begin >= count) return;
    uint lanes = min(count - begin, (uint)BLOCK), done = 0;
    __global const float *in = blocks + (size_t)begin * all + first * BLOCK;
#if LANES == 16
    for (; lanes == BLOCK && done + 16 <= attributes; done += 16) {
        float16 lines[16];
        for (uint i = 0; i < 16; i++) lines[i] = vload16(done + i, in);
        transpose(lines);
        for (uint lane = 0; lane < BLOCK; lane++)
            vstore16(lines[lane], 0, values + (size_t)rows[begin + lane] * attributes + done);
    }
#endif
    for (uint lane = 0; lane < lanes; lane++) {
        __global float *out = values + (size_t)rows[begin + lane] * attributes;
        for (uint i = done; i < attributes; i++) out[i] = in[i * BLOCK + lane];
    }
}

// The storage order is that of the rows.
__kernel void into_blocks(uint count, uint attributes, uint first, uint all,
                          __global const float *values,  // [K,attributes]
                          __global float *blocks) {      // [blocks,all,BLOCK], padded with zeros
    uint begin = get_global_id(0) * BLOCK, done = 0;
    if (begin >= max(count, 1u)) return;
    __global const float *in = values + (size_t)begin * attributes;
    __global float *out = blocks + (size_t)begin * all + first * BLOCK;
#if LANES == 16
    for (; begin + BLOCK <= count && done + 16 <= attributes; done += 16) {
        float16 lines[16];
        for (uint lane = 0; lane < BLOCK; lane++) lines[lane] = vload16(0, in + lane * attributes + done);
        transpose(lines);
        for (uint i = 0; i < 16; i++) vstore16(lines[i], done + i, out);
    }
#endif
    for (uint i = done; i < attributes; i++)
        for (uint lane = 0; lane < BLOCK; lane++)
            out[i * BLOCK + lane] = begin + lane < count ? in[i + lane * attributes] : 0.0f;
}
