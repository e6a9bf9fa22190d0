// Blending along the rays through points in space.
//
// Opacity at points: 1 - T of a view's rays at these points (Yu et al. 2024, GOF).
//
// A Gaussian with its maximum t* before the point counts as in a pixel; one with t* behind it counts by its value at the
// point. A work-item handles LANES points of one tile: their pixel positions and view depths.

#if LANES == 16
#define LOAD_POINTS(i) vload16(3 * item + (i), points)
#define LOAD_OWNERS vload16(item, owners)
#define STORE_POINTS(value) vstore16(value, item, values)
#else
#define LOAD_POINTS(i) points[3 * item + (i)]
#define LOAD_OWNERS owners[item]
#define STORE_POINTS(value) values[item] = (value)
#endif

__kernel void blend_points(uint items,
                           __global const float *points,      // [items,3,LANES]
                           __global const uint *tiles,        // [items]
                           __global const float *splats,      // [K,SPLAT]
                           __global const uint *entries,      // [E]
                           __global const uint *tile_starts,  // [tiles+1]
                           __global float *values) {          // [items,LANES]: opacities
    uint item = get_global_id(0);
    if (item >= items) return;
    V u = LOAD_POINTS(0), v = LOAD_POINTS(1), depth = LOAD_POINTS(2), T = (V)1.0f;
    uint end = tile_starts[tiles[item] + 1];
    // A point is finished when T < TRANSMITTANCE_MIN: the rest would change its opacity by less than that.
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

// The contribution of each Gaussian on the ray through its centre: its alpha there, times what the Gaussians before it let
// through. `owners` are the positions in storage of the Gaussians whose centres the points are.
__kernel void blend_centres(uint items,
                            __global const float *points,      // [items,3,LANES]
                            __global const uint *tiles,        // [items]
                            __global const float *splats,      // [K,SPLAT]
                            __global const uint *entries,      // [E]
                            __global const uint *tile_starts,  // [tiles+1]
                            __global float *values,            // [items,LANES]: contributions
                            __global const uint *owners) {     // [items,LANES]
    uint item = get_global_id(0);
    if (item >= items) return;
    V u = LOAD_POINTS(0), v = LOAD_POINTS(1), T = (V)1.0f, contribution = (V)0.0f;
    U owner = LOAD_OWNERS;
    uint end = tile_starts[tiles[item] + 1];
    I open = MASK(T > (V)0.0f);
    for (uint entry = tile_starts[tiles[item]]; entry < end && ANY(open); entry++) {
        float s[SPLAT_CHANNELS];
        for (int i = 0; i < SPLAT_CHANNELS; i++) s[i] = splats[(size_t)SPLAT * entries[entry] + i];
        V dx = u - s[SPLAT_U], terms[ROW_TERMS], norm, peak;
        row_terms(v - s[SPLAT_V], s, terms);
        V exponent = ray_exponent(s[SPLAT_A] * dx + terms[0], terms[1], s[SPLAT_LX] * dx + terms[2], s, &norm, &peak);
        V weight = blend(peak > (V)NEAR_PLANE ? exponent : (V)-1000.0f, &T);
        I own = MASK(owner == (U)entries[entry]);
        contribution = AS_FLOAT(AS_INT(contribution) | (AS_INT(weight) & own));
        open &= ~own & MASK(T > (V)0.0f);
    }
    STORE_POINTS(contribution);
}
