// The radii of splats as rasterizers return them, in whole pixels, or 0 for a Gaussian that is not in front of the camera or
// that they do not draw.

#define LEAST_SPREAD 0.1f  // of the eigenvalues, in square pixels (3DGS)
#define MOST_DEVIATIONS 3.33f  // (gsplat)
#define LN_255 5.5412636f

// Whether [centre - radius, centre + radius] touches one of the tiles of `pixels`, which are counted from 0 at their centres.
inline I touches_a_tile(V centre, V radius, int pixels) {
    V tiles = (V)((pixels + TILE - 1) / TILE);
    V first = trunc((centre - radius) / TILE), end = trunc((centre + radius + (TILE - 1)) / TILE);
    return MASK(MIN(MAX(end, (V)0.0f), tiles) > MIN(MAX(first, (V)0.0f), tiles));
}

typedef union {
    I v;
    int i[LANES];
} Pixels;

// The spread of the Gaussians at `position`, and their centres in pixels, counted from 0 at the border; returns those in front.
inline I spread_at(uint position, int width, int height, __constant const float *camera, __global const float *geometry,
                   Spread *spread, V *u, V *v) {
    V world[3] = {MEAN(0), MEAN(1), MEAN(2)}, scales[3] = {SCALE(0), SCALE(1), SCALE(2)}, mean[3], axes[9];
#pragma unroll
    for (int i = 0; i < 3; i++)
        mean[i] = CAMERA_VIEW(i, 0) * world[0] + CAMERA_VIEW(i, 1) * world[1] + CAMERA_VIEW(i, 2) * world[2] +
                  CAMERA_VIEW(i, 3);
    view_axes(camera, geometry, position, axes);
    *spread = ewa_spread(camera, width, height, mean, scales, axes);
    *u = CAMERA_FX * mean[0] / mean[2] + CAMERA_CX;
    *v = CAMERA_FY * mean[1] / mean[2] + CAMERA_CY;
    return MASK(mean[2] > (V)NEAR_PLANE);
}

// 3DGS: three deviations along the longer axis, of squares of that radius that touch a tile.
__kernel void splat_radii(uint count, int width, int height,
                          __constant const float *camera,  // [24]
                          __global const float *geometry,  // [blocks,GEOMETRY_ATTRIBUTES,BLOCK]
                          __global const uint *rows,       // [K], the row at each position
                          __global int *radii) {           // [K], by row
    uint position = get_global_id(0) * LANES;
    if (position >= count) return;
    Spread e;
    V u, v;
    I visible = spread_at(position, width, height, camera, geometry, &e, &u, &v);
    V half_difference = 0.5f * (e.xx - e.yy);
    V spread = sqrt(MAX(half_difference * half_difference + e.xy * e.xy, (V)LEAST_SPREAD));
    V radius = ceil(3.0f * sqrt(0.5f * (e.xx + e.yy) + spread));
    visible &= touches_a_tile(u - 0.5f, radius, width) & touches_a_tile(v - 0.5f, radius, height);
    Pixels pixels;
    pixels.v = visible ? TO_INT(radius) : (I)0;
    for (uint lane = 0; lane < LANES && position + lane < count; lane++) radii[rows[position + lane]] = pixels.i[lane];
}

// gsplat: along x and y, as far as alpha reaches 1 / 255, of boxes that touch the image.
__kernel void splat_extents(uint count, int width, int height,
                            __constant const float *camera,  // [24]
                            __global const float *geometry,  // [blocks,GEOMETRY_ATTRIBUTES,BLOCK]
                            __global const uint *rows,       // [K], the row at each position
                            __global int *radii) {           // [K,2], by row
    uint position = get_global_id(0) * LANES;
    if (position >= count) return;
    Spread e;
    V u, v;
    I visible = spread_at(position, width, height, camera, geometry, &e, &u, &v);
    V deviations = MIN(sqrt(2.0f * (log(OPACITY) + LN_255)), (V)MOST_DEVIATIONS);
    V extent_x = ceil(deviations * sqrt(e.xx)), extent_y = ceil(deviations * sqrt(e.yy));
    visible &= MASK(OPACITY >= (V)ALPHA_MIN);
    visible &= MASK(u + extent_x > (V)0.0f) & MASK(u - extent_x < (V)width);
    visible &= MASK(v + extent_y > (V)0.0f) & MASK(v - extent_y < (V)height);
    Pixels across, along;
    across.v = visible ? TO_INT(extent_x) : (I)0;
    along.v = visible ? TO_INT(extent_y) : (I)0;
    for (uint lane = 0; lane < LANES && position + lane < count; lane++) {
        radii[2 * rows[position + lane]] = across.i[lane];
        radii[2 * rows[position + lane] + 1] = along.i[lane];
    }
}
