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
        float s[SPLAT_CHANNELS];
        for (int i = 0; i < SPLAT_CHANNELS; i++) s[i] = splats[(size_t)SPLAT * entries[entry] + i];
        V dx = u - s[SPLAT_U], terms[ROW_TERMS], norm, peak;
        row_terms(v - s[SPLAT_V], s, terms);
        V exponent = ray_exponent(s[SPLAT_A] * dx + terms[0], terms[1], s[SPLAT_LX] * dx + terms[2], s, &norm, &peak);
        V before = MAX(peak - depth, (V)0.0f);
        V alpha = bounded_alpha(exponent - s[SPLAT_G] * (norm * (before * before)));
        alpha = AS_FLOAT(AS_INT(alpha) & MASK(peak > (V)NEAR_PLANE) & open);
        T -= alpha * T;
        open = MASK(T >= (V)TRANSMITTANCE_MIN);
    }
    STORE_POINTS(1.0f - T);
}
