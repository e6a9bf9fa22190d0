// The radii of splats as the rasterizer of 3DGS returns them: three deviations along the longer axis, in whole pixels, or 0 for
// a Gaussian that is not in front of the camera, or whose square of that radius touches no tile.

#define LEAST_SPREAD 0.1f  // of the eigenvalues, in square pixels

// Whether [centre - radius, centre + radius] touches one of the tiles of `pixels`, which are counted from 0 at their centres.
inline I touches_a_tile(V centre, V radius, int pixels) {
    V tiles = (V)((pixels + TILE - 1) / TILE);
    V first = trunc((centre - radius) / TILE), end = trunc((centre + radius + (TILE - 1)) / TILE);
    return MASK(MIN(MAX(end, (V)0.0f), tiles) > MIN(MAX(first, (V)0.0f), tiles));
}

__kernel void splat_radii(uint count, int width, int height,
                          __constant const float *camera,  // [24]
                          __global const float *geometry,  // [blocks,GEOMETRY_ATTRIBUTES,BLOCK]
                          __global const uint *rows,       // [K], the row at each position
                          __global int *radii) {           // [K], by row
    uint position = get_global_id(0) * LANES;
    if (position >= count) return;
    V world[3] = {MEAN(0), MEAN(1), MEAN(2)}, scales[3] = {SCALE(0), SCALE(1), SCALE(2)}, mean[3], axes[9];
#pragma unroll
    for (int i = 0; i < 3; i++)
        mean[i] = CAMERA_VIEW(i, 0) * world[0] + CAMERA_VIEW(i, 1) * world[1] + CAMERA_VIEW(i, 2) * world[2] +
                  CAMERA_VIEW(i, 3);
    view_axes(camera, geometry, position, axes);
    Spread e = ewa_spread(camera, width, height, mean, scales, axes);
    V half_difference = 0.5f * (e.xx - e.yy);
    V spread = sqrt(MAX(half_difference * half_difference + e.xy * e.xy, (V)LEAST_SPREAD));
    V radius = ceil(3.0f * sqrt(0.5f * (e.xx + e.yy) + spread));
    V u = CAMERA_FX * mean[0] / mean[2] + CAMERA_CX - 0.5f, v = CAMERA_FY * mean[1] / mean[2] + CAMERA_CY - 0.5f;
    I visible = MASK(mean[2] > (V)NEAR_PLANE) & touches_a_tile(u, radius, width) & touches_a_tile(v, radius, height);
    union {
        I v;
        int i[LANES];
    } pixels;
    pixels.v = visible ? TO_INT(radius) : (I)0;
    for (uint lane = 0; lane < LANES && position + lane < count; lane++) radii[rows[position + lane]] = pixels.i[lane];
}
