// Gradient of the blended image, cpu style: one work-item per tile, front to back as in the forward pass, nothing stored.
//
// With g = dL/dimage and F = final colour . g of a pixel, walking front to back: after Gaussian k with colour c, weight
// w = alpha T, the part of F that lies behind it is F <- F - w c . g, and
//   dL/dalpha = T c . g - F / (1 - alpha)          (F after the update; the background is in the final colour)
//   dL/dc     = w g
// The exponent p = log2 alpha is a quadratic form of the pixel's offset d from the splat's centre, so its gradients are
// the moments of dL/dp, summed over the tile and kept in the entry's slot. They are taken in the splat's own measures
// a = A dx + B dy and b = C dy (layout.cl): 1, a, b, a^2, a b, b^2. Moments of dx and dy would, for needles, be large
// numbers with a small difference.

#define CHUNK 16  // entries that are staged together, and between looks at which rows are still alive

inline uint union16(int16 v) {
    int8 a = v.lo | v.hi;
    int4 b = a.lo | a.hi;
    int2 c = b.lo | b.hi;
    return c.x | c.y;
}

// sum16 of eight vectors, added in the same order, with a third of the shuffles.
inline float8 sums16(const float16 *v) {
    float16 halves[4], quarters[2];
#pragma unroll
    for (int i = 0; i < 4; i++)
        halves[i] = (float16)(v[2 * i].lo, v[2 * i + 1].lo) + (float16)(v[2 * i].hi, v[2 * i + 1].hi);
#pragma unroll
    for (int i = 0; i < 2; i++) {
        float16 a = halves[2 * i], b = halves[2 * i + 1];
        quarters[i] = (float16)(a.s012389ab, b.s012389ab) + (float16)(a.s4567cdef, b.s4567cdef);
    }
    float16 a = quarters[0], b = quarters[1];
    float16 pairs = (float16)(a.s014589cd, b.s014589cd) + (float16)(a.s2367abef, b.s2367abef);
    return pairs.even + pairs.odd;
}

#if CHANNELS == 3
// Parts 16 interleaved colours; compiles to shuffles, while 48 loads become slow gathers.
inline void load_colours(__global const float *pixels, float16 *row) {
    float16 a = vload16(0, pixels), b = vload16(1, pixels), c = vload16(2, pixels);
    row[0] = (float16)(a.s0369, a.scf, b.s258b, b.se, c.s147a, c.sd);
    row[1] = (float16)(a.s147a, a.sd, b.s0369, b.scf, c.s258b, c.se);
    row[2] = (float16)(a.s258b, a.se, b.s147a, b.sd, c.s0369, c.scf);
}
#endif

// One row of 16 interleaved pixels [16][CHANNELS] -> [CHANNELS] vectors; zero beyond `columns`.
inline void load_row(__global const float *pixels, int columns, float16 *row) {
#if CHANNELS == 3
    if (columns == TILE) {
        load_colours(pixels, row);
        return;
    }
#endif
    union {
        float16 v;
        float f[16];
    } lane;
    for (int c = 0; c < CHANNELS; c++) {
        for (int x = 0; x < 16; x++) lane.f[x] = x < columns ? pixels[x * CHANNELS + c] : 0.0f;
        row[c] = lane.v;
    }
}

__kernel __attribute__((reqd_work_group_size(1, 1, 1)))
void blend_tiles_backward(int width, int height, int tiles_x, int first_tile,
                          __global const float *splats,          // [K,SPLAT]
                          __global const uint2 *entries,         // [E], (position, slot)
                          __global const uint *tile_starts,      // [tiles+1]
                          __global const float *image,           // [H,W,CHANNELS]
                          __global const float *image_gradient,  // [H,W,CHANNELS]
                          __global float *slot_gradients) {      // [E,SLOT_GRADIENT]
    int tile = get_global_id(0);
    uint next = tile_starts[tile], end = tile_starts[tile + 1];
    int left = (first_tile + tile) % tiles_x * TILE, top = (first_tile + tile) / tiles_x * TILE;
    const float16 steps = (float16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    const float16 column = steps + (left + 0.5f), row = steps + (top + 0.5f);
    const int16 bit_of_row = (int16)(1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384, 32768);

    float16 T[TILE], F[TILE], g[TILE * CHANNELS];
    int rows = min(TILE, height - top), columns = min(TILE, width - left);
    float16 fresh = column < (float16)width ? (float16)1.0f : (float16)-1.0f;
    for (int r = 0; r < rows; r++) {
        size_t pixel = ((size_t)(top + r) * width + left) * CHANNELS;
        float16 colour[CHANNELS];
        load_row(image + pixel, columns, colour);
        load_row(image_gradient + pixel, columns, g + r * CHANNELS);
        T[r] = fresh;
        F[r] = (float16)0.0f;
        for (int c = 0; c < CHANNELS; c++) F[r] += colour[c] * g[r * CHANNELS + c];
    }

    float staged[CHUNK * SPLAT], slants[CHUNK * TILE], levels[CHUNK * TILE], downs[CHUNK * TILE];
    uint reached[CHUNK];  // bits of the rows
    uint live = (1u << rows) - 1, count;
    for (; next < end && live; next += count) {
        count = min((uint)CHUNK, end - next);
        for (uint j = 0; j < count; j++) {  // nothing but loads, as in the forward pass
            __global const float *s = splats + (size_t)SPLAT * entries[next + j].x;
            for (int i = 0; i < SPLAT / 16; i++) vstore16(vload16(i, s), i, staged + SPLAT * j);
        }
        for (uint j = 0; j < count; j++) {
            const float *s = staged + SPLAT * j;
            float16 dy = row - s[SPLAT_V], terms[ROW_TERMS];
            row_terms(dy, s, terms);
            reached[j] = union16(reached_rows(column - s[SPLAT_U], terms, s) & bit_of_row);
            vstore16(terms[0], j, slants);
            vstore16(terms[1], j, levels);
            vstore16(s[SPLAT_C] * dy, j, downs);
        }
        for (uint j = 0; j < count; j++) {
            const float *s = staged + SPLAT * j, *slant = slants + TILE * j, *level = levels + TILE * j, *down = downs + TILE * j;
            float16 dx = column - s[SPLAT_U], sums[MOMENTS + CHANNELS], *moments = sums, *dc = sums + MOMENTS;
#pragma unroll
            for (int i = 0; i < MOMENTS; i++) moments[i] = (float16)0.0f;
#pragma unroll
            for (int c = 0; c < CHANNELS; c++) dc[c] = (float16)0.0f;
            for (uint rest = reached[j] & live; rest; rest &= rest - 1) {
                uint r = popcount((rest & -rest) - 1);
                float16 a = s[SPLAT_A] * dx + slant[r], b = (float16)down[r];
                float16 exponent = level[r] - a * a;
                float16 weight = blend(exponent, (float16)INFINITY, &T[r]);
                float16 along = (float16)0.0f;
#pragma unroll
                for (int c = 0; c < CHANNELS; c++) {
                    along += g[r * CHANNELS + c] * s[SPLAT_CHANNELS + c];
                    dc[c] += weight * g[r * CHANNELS + c];
                }
                F[r] -= weight * along;
                // Where it was not blended, and at the clamp, nothing flows back. (Compared as integers, weights take one
                // instruction less.)
                float16 alpha = exp2_polynomial(exponent);
                int16 flows = (as_int16(weight) > 0) & (alpha < (float16)ALPHA_MAX);
                float16 dp = LN2 * (weight * along - F[r] * (alpha / (1.0f - alpha)));
                dp = flows ? dp : (float16)0.0f;
                float16 dpa = dp * a, dpb = dp * b;
                moments[0] += dp;
                moments[1] += dpa;
                moments[2] += dpb;
                moments[3] += dpa * a;
                moments[4] += dpa * b;
                moments[5] += dpb * b;
            }
            __global float *out = slot_gradients + (size_t)SLOT_GRADIENT * entries[next + j].y;
#pragma unroll
            for (int i = 0; i + 8 <= SLOT_GRADIENT; i += 8) vstore8(sums16(sums + i), 0, out + i);
#pragma unroll
            for (int i = SLOT_GRADIENT / 8 * 8; i < SLOT_GRADIENT; i++) out[i] = sum16(sums[i]);
        }
        int16 alive = (int16)0;
        for (int r = 0; r < rows; r++) alive |= T[r] > (float16)0.0f ? (int16)(1 << r) : (int16)0;
        live &= union16(alive);
    }
    for (; next < end; next++) {  // entries behind the point where every pixel had finished
        __global float *out = slot_gradients + (size_t)SLOT_GRADIENT * entries[next].y;
#pragma unroll
        for (int i = 0; i < SLOT_GRADIENT; i++) out[i] = 0.0f;
    }
}
