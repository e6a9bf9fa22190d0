// Front-to-back blending, cpu style: one work-item per tile, a row of 16 pixels per float16, no barriers.
//
// The tile's list is walked in chunks of CHUNK entries. A chunk's splats are staged in private memory together with their
// row terms (blending.cl) and the blocks of four rows that each one reaches. Then block after block: the state of its four
// rows stays in registers while those that reach it go by. Blocks whose pixels are all finished are left out of later
// chunks.

#define CHUNK 32
#define ROWS 4  // rows of a block; two would spare a tenth of the evaluations and cost more in loads
#define BLOCKS (TILE / ROWS)
#define FINISHED (MEDIAN_DEPTH ? MEDIAN_TRANSMITTANCE : 0.0f)  // T of pixels that need no further Gaussian

inline float max16(float16 v) {
    float8 a = MAX(v.lo, v.hi);
    float4 b = MAX(a.lo, a.hi);
    float2 c = MAX(b.lo, b.hi);
    return MAX(c.x, c.y);
}

// Interleaves 16 colours; compiles to shuffles, a tenth of the time of 48 stores.
inline void store_colours(float16 r, float16 g, float16 b, __global float *pixels) {
    vstore16((float16)(r.s0, g.s0, b.s0, r.s1, g.s1, b.s1, r.s2, g.s2, b.s2, r.s3, g.s3, b.s3, r.s4, g.s4, b.s4, r.s5), 0, pixels);
    vstore16((float16)(g.s5, b.s5, r.s6, g.s6, b.s6, r.s7, g.s7, b.s7, r.s8, g.s8, b.s8, r.s9, g.s9, b.s9, r.sa, g.sa), 1, pixels);
    vstore16((float16)(b.sa, r.sb, g.sb, b.sb, r.sc, g.sc, b.sc, r.sd, g.sd, b.sd, r.se, g.se, b.se, r.sf, g.sf, b.sf), 2, pixels);
}

__kernel __attribute__((reqd_work_group_size(1, 1, 1)))
void blend_tiles(int width, int height, int tiles_x, int first_tile,
                 __global const float *splats,        // [K,SPLAT]
                 __global const uint2 *entries,       // [E], (position, slot)
                 __global const uint *tile_starts,    // [tiles+1]
                 __constant const float *background,  // [CHANNELS]
                 __global float *image,               // [H,W,CHANNELS]
                 __global float *transmittance,       // [H,W]
                 __global float *median_depth,        // [H,W]
                 __global float *partials) {          // [E,3]
    int tile = get_global_id(0);
    uint begin = tile_starts[tile], end = tile_starts[tile + 1];
    int left = (first_tile + tile) % tiles_x * TILE, top = (first_tile + tile) / tiles_x * TILE;
    const float16 steps = (float16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    const float16 column = steps + (left + 0.5f), row = steps + (top + 0.5f);

    float16 T[TILE];
    int rows = min(TILE, height - top);
    // Pixels outside the image start finished.
    float16 fresh = column < (float16)width ? (float16)1.0f : (float16)-1.0f;
    for (int r = 0; r < TILE; r++) T[r] = r < rows ? fresh : (float16)-1.0f;
#if CHANNELS > 0
    float16 channels[TILE * CHANNELS];
    for (int i = 0; i < TILE * CHANNELS; i++) channels[i] = (float16)0.0f;
#endif
#if MEDIAN_DEPTH
    float16 depths[TILE];
    for (int r = 0; r < TILE; r++) depths[r] = (float16)INFINITY;
#endif

    float staged[CHUNK * SPLAT], terms[CHUNK * ROW_TERMS * TILE];
    int blocks[CHUNK * BLOCKS];  // -1 where a splat reaches the block, else 0
#if CONTRIBUTIONS
    float16 sums[CHUNK], maxima[CHUNK];
    int16 pixels[CHUNK];
#endif
    uint live = (1u << ((rows + ROWS - 1) / ROWS)) - 1;
    uint next = begin;
    while (next < end && live) {
        uint count = min((uint)CHUNK, end - next);
        for (uint j = 0; j < count; j++) {  // nothing but loads, so that many cache misses are under way at a time
            __global const float *s = splats + (size_t)SPLAT * entries[next + j].x;
            for (int i = 0; i < SPLAT / 16; i++) vstore16(vload16(i, s), i, staged + SPLAT * j);
        }
        for (uint j = 0; j < count; j++) {
            const float *s = staged + SPLAT * j;
            float16 of_rows[ROW_TERMS];
            row_terms(row - s[SPLAT_V], s, of_rows);
            for (int i = 0; i < ROW_TERMS; i++) vstore16(of_rows[i], ROW_TERMS * j + i, terms);
            int16 reached = reached_rows(column - s[SPLAT_U], of_rows, s);
            int8 pairs = reached.even | reached.odd;
            vstore4(pairs.even | pairs.odd, j, blocks);
#if CONTRIBUTIONS
            sums[j] = maxima[j] = (float16)0.0f;
            pixels[j] = (int16)0;
#endif
        }
        for (int b = 0; b < BLOCKS; b++) {
            if (!(live >> b & 1)) continue;
            float16 t[ROWS];
#if CHANNELS > 0
            float16 c[ROWS * CHANNELS];
#endif
#pragma unroll
            for (int r = 0; r < ROWS; r++) {
                t[r] = T[ROWS * b + r];
#if CHANNELS > 0
#pragma unroll
                for (int i = 0; i < CHANNELS; i++) c[r * CHANNELS + i] = channels[(ROWS * b + r) * CHANNELS + i];
#endif
            }
            uint reaching[CHUNK], n = 0;  // listed without a branch, which would often be mispredicted
            for (uint j = 0; j < count; j++) {
                reaching[n] = j;
                n -= blocks[BLOCKS * j + b];
            }
            for (uint i = 0; i < n; i++) {
                uint j = reaching[i];
                const float *s = staged + SPLAT * j;
                const float *of_block = terms + TILE * ROW_TERMS * j + ROWS * b;
                float16 dx = column - s[SPLAT_U];
#pragma unroll
                for (int r = 0; r < ROWS; r++) {
                    float16 depth, exponent = log2_alpha(dx, of_block + r, s, &depth);
#if MEDIAN_DEPTH
                    float16 before = t[r];
#endif
                    float16 weight = blend(exponent, depth, &t[r]);
#if CHANNELS > 0
#pragma unroll
                    for (int k = 0; k < CHANNELS; k++)
                        c[r * CHANNELS + k] = weight * s[SPLAT_CHANNELS + k] + c[r * CHANNELS + k];
#endif
#if CONTRIBUTIONS
                    sums[j] += weight;
                    maxima[j] = MAX(maxima[j], weight);
                    pixels[j] += as_int16(weight) >> 29;  // 1 from 2^-63 to 2, where a weight lies that is not 0
#endif
#if MEDIAN_DEPTH
                    int16 crosses = (fabs(before) > (float16)MEDIAN_TRANSMITTANCE) &
                                    (fabs(t[r]) <= (float16)MEDIAN_TRANSMITTANCE);
                    depths[ROWS * b + r] = crosses ? depth : depths[ROWS * b + r];
#endif
                }
            }
            float16 most = t[0];
#pragma unroll
            for (int r = 0; r < ROWS; r++) {
                most = MAX(most, t[r]);
                T[ROWS * b + r] = t[r];
#if CHANNELS > 0
#pragma unroll
                for (int i = 0; i < CHANNELS; i++) channels[(ROWS * b + r) * CHANNELS + i] = c[r * CHANNELS + i];
#endif
            }
            if (!any(most > (float16)FINISHED)) live &= ~(1u << b);
        }
#if CONTRIBUTIONS
        for (uint j = 0; j < count; j++) {
            __global float *partial = partials + (size_t)3 * entries[next + j].y;
            partial[0] = sum16(sums[j]);
            partial[1] = max16(maxima[j]);
            partial[2] = as_float((uint)sum16(convert_float16(pixels[j])));
        }
#endif
        next += count;
    }
#if CONTRIBUTIONS
    for (; next < end; next++) {  // entries behind the point where every pixel had finished
        __global float *partial = partials + (size_t)3 * entries[next].y;
        partial[0] = partial[1] = partial[2] = 0.0f;
    }
#endif

    int columns = min(TILE, width - left);
    for (int r = 0; r < rows; r++) {
        size_t pixel = (size_t)(top + r) * width + left;
        union {
            float16 v;
            float f[16];
        } lane;
        float16 rest = fabs(T[r]);
#if CHANNELS == 3
        if (columns == TILE) {
            float16 colour[3];
            for (int i = 0; i < 3; i++) colour[i] = channels[3 * r + i] + rest * background[i];
            store_colours(colour[0], colour[1], colour[2], image + 3 * pixel);
        } else
#endif
#if CHANNELS > 0
        for (int i = 0; i < CHANNELS; i++) {
            lane.v = channels[r * CHANNELS + i] + rest * background[i];
            for (int x = 0; x < columns; x++) image[(pixel + x) * CHANNELS + i] = lane.f[x];
        }
#endif
        lane.v = rest;
        for (int x = 0; x < columns; x++) transmittance[pixel + x] = lane.f[x];
#if MEDIAN_DEPTH
        lane.v = depths[r];
        for (int x = 0; x < columns; x++) median_depth[pixel + x] = lane.f[x];
#endif
    }
}
