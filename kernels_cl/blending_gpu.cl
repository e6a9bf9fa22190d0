// Front-to-back blending, gpu style: one work-group of 16 x 16 per tile, a pixel per work-item.
//
// The tile's list is walked in batches of BATCH entries (at most 256), staged in local memory by the whole group. Weights
// are gathered per entry in local memory with integer atomics (2^-23 fixed point: 256 weights below 1 fit in 32 bits),
// so that the sums do not depend on the order of arrival.

#define STAGED (SPLAT_CHANNELS + CHANNELS)
#define FIXED_POINT 8388608.0f
#define FINISHED (MEDIAN_DEPTH ? MEDIAN_TRANSMITTANCE : 0.0f)  // T of pixels that need no further Gaussian

__kernel __attribute__((reqd_work_group_size(TILE * TILE, 1, 1)))
void blend_tiles(int width, int height, int tiles_x, int first_tile,
                 __global const float *splats,        // [K,SPLAT]
                 __global const uint2 *entries,       // [E], (position, slot)
                 __global const uint *tile_starts,    // [tiles+1]
                 __constant const float *background,  // [CHANNELS]
                 __global float *image,               // [H,W,CHANNELS]
                 __global float *transmittance,       // [H,W]
                 __global float *median_depth,        // [H,W]
                 __global float *partials) {          // [E,3]
    __local float staged[BATCH * STAGED];
    __local uint unfinished;
#if CONTRIBUTIONS
    __local uint sums[BATCH], maxima[BATCH], pixels[BATCH];
#endif
    int item = get_local_id(0), tile = get_group_id(0);
    uint begin = tile_starts[tile], end = tile_starts[tile + 1];
    int x = (first_tile + tile) % tiles_x * TILE + item % TILE, y = (first_tile + tile) / tiles_x * TILE + item / TILE;
    bool inside = x < width && y < height;

    float T = inside ? 1.0f : -1.0f;
#if CHANNELS > 0
    float channels[CHANNELS];
    for (int i = 0; i < CHANNELS; i++) channels[i] = 0.0f;
#endif
#if MEDIAN_DEPTH
    float median = INFINITY;
#endif

    for (uint first = begin; first < end; first += BATCH) {
        if (item == 0) unfinished = 0;
        barrier(CLK_LOCAL_MEM_FENCE);
        if (T > FINISHED) atomic_inc(&unfinished);
        barrier(CLK_LOCAL_MEM_FENCE);
        bool finished = unfinished == 0;  // the same for the whole group
        uint count = min((uint)BATCH, end - first);
        if (!finished && item < count) {
            __global const float *s = splats + (size_t)SPLAT * entries[first + item].x;
            for (int i = 0; i < STAGED; i++) staged[item * STAGED + i] = s[i];
        }
#if CONTRIBUTIONS
        if (item < BATCH) sums[item] = maxima[item] = pixels[item] = 0;
#endif
        barrier(CLK_LOCAL_MEM_FENCE);
        for (uint j = 0; j < count && !finished; j++) {
            if (T <= FINISHED) break;
            float s[STAGED], terms[ROW_TERMS], depth;
            for (int i = 0; i < STAGED; i++) s[i] = staged[j * STAGED + i];
#if MEDIAN_DEPTH
            float before = T;
#endif
            row_terms(y + 0.5f - s[SPLAT_V], s, terms);
            float exponent = log2_alpha(x + 0.5f - s[SPLAT_U], terms, s, &depth), weight = blend(exponent, depth, &T);
            if (weight <= 0.0f) continue;
#if CHANNELS > 0
            for (int i = 0; i < CHANNELS; i++) channels[i] += weight * s[SPLAT_CHANNELS + i];
#endif
#if CONTRIBUTIONS
            atomic_add(&sums[j], (uint)(weight * FIXED_POINT + 0.5f));
            atomic_max(&maxima[j], as_uint(weight));  // positive floats order as their bits do
            atomic_inc(&pixels[j]);
#endif
#if MEDIAN_DEPTH
            if (before > MEDIAN_TRANSMITTANCE && T <= MEDIAN_TRANSMITTANCE) median = depth;
#endif
        }
#if CONTRIBUTIONS
        barrier(CLK_LOCAL_MEM_FENCE);
        if (item < count) {
            __global float *partial = partials + (size_t)3 * entries[first + item].y;
            partial[0] = sums[item] / FIXED_POINT;
            partial[1] = as_float(maxima[item]);
            partial[2] = as_float(pixels[item]);
        }
#else
        if (finished) break;
#endif
        barrier(CLK_LOCAL_MEM_FENCE);
    }

    if (!inside) return;
    size_t pixel = (size_t)y * width + x;
#if CHANNELS > 0
    for (int i = 0; i < CHANNELS; i++) image[pixel * CHANNELS + i] = channels[i] + fabs(T) * background[i];
#endif
    transmittance[pixel] = fabs(T);
#if MEDIAN_DEPTH
    median_depth[pixel] = median;
#endif
}
