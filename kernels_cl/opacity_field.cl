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

// The lists of a kernel: splats [K,SPLAT] by entries [E] (position, slot) of the tiles [items] of its points [items,3,LANES].
#define POINTS_OF_TILES                                                     \
    uint items, __global const float *points, __global const uint *tiles,   \
        __global const float *splats, __global const uint2 *entries,        \
        __global const uint *tile_starts
#define FIRST_ENTRY tile_starts[tiles[item]]
#define END_OF_ENTRIES tile_starts[tiles[item] + 1]

// The exponent of a Gaussian on the rays through (u, v), their norms, and the depths at which it is reached.
inline V load_exponent(__global const float *splat, V u, V v, float *s, V *norm, V *peak) {
    for (int i = 0; i < SPLAT_CHANNELS; i++) s[i] = splat[i];
    V dx = u - s[SPLAT_U], terms[ROW_TERMS];
    row_terms(v - s[SPLAT_V], s, terms);
    return ray_exponent(s[SPLAT_A] * dx + terms[0], terms[1], s[SPLAT_LX] * dx + terms[2], s, norm, peak);
}

__kernel void blend_points(POINTS_OF_TILES,
                           __global float *values,  // [items,LANES]: opacities
                           float least) {
    uint item = get_global_id(0);
    if (item >= items) return;
    float s[SPLAT_CHANNELS];
    V u = LOAD_POINTS(0), v = LOAD_POINTS(1), depth = LOAD_POINTS(2), T = (V)1.0f, norm, peak;
    // A point is finished when T < least: the rest would change its opacity by less than that.
    I open = MASK(T >= (V)least);
    for (uint entry = FIRST_ENTRY, end = END_OF_ENTRIES; entry < end && ANY(open); entry++) {
        V exponent = load_exponent(splats + (size_t)SPLAT * entries[entry].x, u, v, s, &norm, &peak);
        V before = MAX(peak - depth, (V)0.0f);
        V alpha = bounded_alpha(exponent - s[SPLAT_G] * (norm * (before * before)), peak);
        alpha = AS_FLOAT(AS_INT(alpha) & open);
        T -= alpha * T;
        open = MASK(T >= (V)least);
    }
    STORE_POINTS(1.0f - T);
}

// The contribution of each Gaussian on the ray through its centre: its alpha there, times what the Gaussians before it let
// through. `owners` are the positions in storage of the Gaussians whose centres the points are.
__kernel void blend_centres(POINTS_OF_TILES,
                            __global float *values,         // [items,LANES]: contributions
                            __global const uint *owners) {  // [items,LANES]
    uint item = get_global_id(0);
    if (item >= items) return;
    float s[SPLAT_CHANNELS];
    V u = LOAD_POINTS(0), v = LOAD_POINTS(1), T = (V)1.0f, contribution = (V)0.0f, norm, peak;
    U owner = LOAD_OWNERS;
    I open = MASK(T > (V)0.0f);
    for (uint entry = FIRST_ENTRY, end = END_OF_ENTRIES; entry < end && ANY(open); entry++) {
        V exponent = load_exponent(splats + (size_t)SPLAT * entries[entry].x, u, v, s, &norm, &peak);
        I own = MASK(owner == (U)entries[entry].x);
        // Through its own centre, sin^2 = 0 and t* = z; rounded centres may miss Gaussians thinner than 1e-7 of their depth.
        exponent = own ? (V)s[SPLAT_LOG2_OPACITY] : exponent;
        V weight = blend(exponent, own ? (V)INFINITY : peak, &T);
        contribution = AS_FLOAT(AS_INT(contribution) | (AS_INT(weight) & own));
        open &= ~own & MASK(T > (V)0.0f);
    }
    STORE_POINTS(contribution);
}
