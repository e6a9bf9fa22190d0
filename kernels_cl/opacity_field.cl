// Opacity at points in space: what one view has blended when its rays arrive there (Yu et al. 2024, GOF).
//
// A Gaussian that has its maximum t* along a point's ray before the point counts as it does in a pixel; one that has it
// behind counts by its value at the point. Points come by tile, LANES of one tile to a work-item: their pixel positions
// and view depths, [items][3][LANES].

#if LANES == 16
#define LOAD_POINTS(i) vload16(3 * item + (i), points)
#define STORE_POINTS(value) vstore16(value, item, opacities)
#else
#define LOAD_POINTS(i) points[3 * item + (i)]
#define STORE_POINTS(value) opacities[item] = (value)
#endif

__kernel void blend_points(uint items, __global const float *points, __global const uint *tiles,
                           __global const float *splats, __global const uint *entries,
                           __global const uint *tile_starts, __global float *opacities) {
    uint item = get_global_id(0);
    if (item >= items) return;
    V u = LOAD_POINTS(0), v = LOAD_POINTS(1), depth = LOAD_POINTS(2), T = (V)1.0f;
    uint end = tile_starts[tiles[item] + 1];
    // A point is done once less than TRANSMITTANCE_MIN is left: what follows would change its opacity by less than that.
    I open = MASK(T >= (V)TRANSMITTANCE_MIN);
    for (uint entry = tile_starts[tiles[item]]; entry < end && ANY(open); entry++) {
        __global const float *s = splats + (size_t)SPLAT * entries[entry];
        V dx = u - s[SPLAT_U], dy = v - s[SPLAT_V];
        V across = s[SPLAT_A] * dx + s[SPLAT_B] * dy, down = s[SPLAT_C] * dy;
        V along = 1.0f + (s[SPLAT_LX] * dx + s[SPLAT_LY] * dy);
        V norm = dx * (2.0f * (s[SPLAT_LX] + s[SPLAT_MXY] * dy) + s[SPLAT_MXX] * dx) +
                 (dy * (2.0f * s[SPLAT_LY] + s[SPLAT_MYY] * dy) + 1.0f);
        V inverse = 1.0f / norm;
        V peak = s[SPLAT_DEPTH] * along * inverse;
        V before = MAX(peak - depth, (V)0.0f);
        V exponent = s[SPLAT_LOG2_OPACITY] - (across * across + down * down) * inverse -
                     s[SPLAT_STEEPNESS] * norm * (before * before);
        V alpha = MIN(exp2_polynomial(exponent), (V)ALPHA_MAX);
        alpha = AS_FLOAT(AS_INT(alpha) & MASK(exponent >= (V)LOG2_ALPHA_MIN) & MASK(peak > (V)NEAR_PLANE) & open);
        T -= alpha * T;
        open = MASK(T >= (V)TRANSMITTANCE_MIN);
    }
    STORE_POINTS(1.0f - T);
}
