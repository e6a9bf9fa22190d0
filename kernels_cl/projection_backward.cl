// Gradient of the EWA projection: moments of dL/dp and colour gradients of the splats -> gradients of means, quaternions,
// scales, opacities, channels, and of the projected centre (for densification).
//
// The forward pass is computed again (projection.cl), so that splats need not be read.

#define MOMENT(i) LOAD_ATTRIBUTE(splat_gradients, SLOT_GRADIENT, i, position)
#define CHANNEL_GRADIENT(c) LOAD_ATTRIBUTE(splat_gradients, SLOT_GRADIENT, MOMENTS + (c), position)

// The stored gradient: zero where there is no splat, or where it overflows.
#define USABLE(gradient) ((visible & MASK(fabs(gradient) <= (V)MAXFLOAT)) ? (gradient) : (V)0.0f)

// dL/dquaternion of R(q / |q|), from axes[3 * a + i] = dL/dR[i][a] in world space.
inline void quaternion_gradient(const V *q, const V *axes, V *gradient) {
    V norm2 = MAX(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3], (V)1e-30f);
    V inverse = 1.0f / sqrt(norm2);
    V w = q[0] * inverse, x = q[1] * inverse, y = q[2] * inverse, z = q[3] * inverse;
    V g00 = axes[0], g10 = axes[1], g20 = axes[2], g01 = axes[3], g11 = axes[4], g21 = axes[5];
    V g02 = axes[6], g12 = axes[7], g22 = axes[8];
    V gw = 2.0f * (x * (g21 - g12) + y * (g02 - g20) + z * (g10 - g01));
    V gx = 2.0f * (y * (g01 + g10) + z * (g02 + g20) + w * (g21 - g12) - 2.0f * x * (g11 + g22));
    V gy = 2.0f * (x * (g01 + g10) + z * (g12 + g21) + w * (g02 - g20) - 2.0f * y * (g00 + g22));
    V gz = 2.0f * (x * (g02 + g20) + y * (g12 + g21) + w * (g10 - g01) - 2.0f * z * (g00 + g11));
    V along = w * gw + x * gx + y * gy + z * gz;  // no gradient along q: its norm does not matter
    gradient[0] = inverse * (gw - w * along);
    gradient[1] = inverse * (gx - x * along);
    gradient[2] = inverse * (gy - y * along);
    gradient[3] = inverse * (gz - z * along);
}

__kernel void project_backward(uint count, int width, int height,
                               __constant const float *camera,         // [24]
                               __global const float *geometry,         // [blocks,GEOMETRY_ATTRIBUTES,BLOCK]
                               __global const float *channels,         // [blocks,CHANNEL_ATTRIBUTES,BLOCK]
                               __global const uint *depth_keys,        // [K]
                               __global const float *splat_gradients,  // [blocks,SLOT_GRADIENT,BLOCK]
                               __global float *geometry_gradients,     // [blocks,GEOMETRY_ATTRIBUTES,BLOCK]
                               __global float *channel_gradients,      // [blocks,CHANNEL_ATTRIBUTES,BLOCK]
                               __global float *centre_gradients) {     // [blocks,2,BLOCK]
    uint position = get_global_id(0) * LANES;
    if (position >= count) return;
    union {
        U v;
        uint u[LANES];
    } key;
    for (uint lane = 0; lane < LANES; lane++)
        key.u[lane] = position + lane < count ? depth_keys[position + lane] : NOT_VISIBLE;
    I visible = MASK(key.v != (U)NOT_VISIBLE);
    if (!ANY(visible)) {
        for (int i = 0; i < GEOMETRY_ATTRIBUTES; i++) STORE_ATTRIBUTE((V)0.0f, geometry_gradients, GEOMETRY_ATTRIBUTES, i);
        for (int i = 0; i < 2; i++) STORE_ATTRIBUTE((V)0.0f, centre_gradients, 2, i);
        for (int i = 0; i < CHANNEL_ATTRIBUTES; i++)
            STORE_ATTRIBUTE((V)0.0f, channel_gradients, CHANNEL_ATTRIBUTES, i);
        return;
    }

    // The forward pass again.
    float fx = CAMERA_FX, fy = CAMERA_FY;
    V world[3] = {MEAN(0), MEAN(1), MEAN(2)}, mean[3], scales[3] = {SCALE(0), SCALE(1), SCALE(2)}, axes[9];
#pragma unroll
    for (int i = 0; i < 3; i++)
        mean[i] = CAMERA_VIEW(i, 0) * world[0] + CAMERA_VIEW(i, 1) * world[1] + CAMERA_VIEW(i, 2) * world[2] +
                  CAMERA_VIEW(i, 3);
    view_axes(camera, geometry, position, axes);
    Spread e = ewa_spread(camera, width, height, mean, scales, axes);
    V iz = 1.0f / mean[2], x = mean[0] * iz, y = mean[1] * iz;
    const V *scale = e.scale, *ux = e.ux, *uy = e.uy;
    V jx = e.jx, jy = e.jy, yy = e.yy;
    // p = log2 o - |n|^2 with n = F d, F = [[A, B], [0, C]] (layout.cl), F'F = HALF_LOG2E Sigma'^-1.
    V C = sqrt((V)HALF_LOG2E / yy), A = C / sqrt(e.determinant) * yy, B = -C / sqrt(e.determinant) * e.xy;
    V gU = 2.0f * A * MOMENT(1), gV = 2.0f * (B * MOMENT(1) + C * MOMENT(2));  // d = pixel - centre

    // Sigma' = sum of v v' + dilation, v = scale u: dL/dSigma' = F'NF / HALF_LOG2E with N the moments of n n', hence
    // dL/dv = 2 F'N (F v) / HALF_LOG2E. For needles F v keeps the digits that a product with Sigma'^-1 loses.
    V naa = MOMENT(3) * (2.0f / HALF_LOG2E), nab = MOMENT(4) * (2.0f / HALF_LOG2E), nbb = MOMENT(5) * (2.0f / HALF_LOG2E);
    V gaxes[9], gscale[3], gjx = (V)0.0f, gjy = (V)0.0f, giz = (V)0.0f;
#pragma unroll
    for (int a = 0; a < 3; a++) {
        V across = A * ux[a] + B * uy[a], down = C * uy[a];  // F u
        V ga = scale[a] * (naa * across + nab * down), gb = scale[a] * (nab * across + nbb * down);
        gscale[a] = ga * across + gb * down;
        giz += gscale[a] * scale[a] * mean[2];  // u is proportional to iz
        V sx = A * ga * scale[a] * (fx * iz), sy = (B * ga + C * gb) * scale[a] * (fy * iz);  // u = f iz (axis - j axis_z)
        gaxes[3 * a] = sx;
        gaxes[3 * a + 1] = sy;
        gaxes[3 * a + 2] = -(sx * jx + sy * jy);
        gjx -= sx * axes[3 * a + 2];
        gjy -= sy * axes[3 * a + 2];
    }
    V gx = fx * gU + (jx == x ? gjx : (V)0.0f), gy = fy * gV + (jy == y ? gjy : (V)0.0f);
    giz += gx * mean[0] + gy * mean[1];
#if SH_DEGREE >= 0 && CHANNELS > 3
    giz += CHANNEL_GRADIENT(3);
#endif
    V gmean[3] = {gx * iz, gy * iz, -giz * iz * iz};

    V gworld[3], gworld_axes[9];
#pragma unroll
    for (int i = 0; i < 3; i++) {
        gworld[i] = CAMERA_VIEW(0, i) * gmean[0] + CAMERA_VIEW(1, i) * gmean[1] + CAMERA_VIEW(2, i) * gmean[2];
#pragma unroll
        for (int a = 0; a < 3; a++)
            gworld_axes[3 * a + i] = CAMERA_VIEW(0, i) * gaxes[3 * a] + CAMERA_VIEW(1, i) * gaxes[3 * a + 1] +
                                     CAMERA_VIEW(2, i) * gaxes[3 * a + 2];
    }
    V q[4] = {QUAT(0), QUAT(1), QUAT(2), QUAT(3)}, gq[4];
    quaternion_gradient(q, gworld_axes, gq);

#if SH_DEGREE >= 0
    V delta[3], basis[SH_BANDS], dbasis[SH_BANDS], direction[3];
#pragma unroll
    for (int i = 0; i < 3; i++) delta[i] = world[i] - CAMERA_CENTRE(i);
    V away = 1.0f / sqrt(delta[0] * delta[0] + delta[1] * delta[1] + delta[2] * delta[2]);
#pragma unroll
    for (int i = 0; i < 3; i++) delta[i] *= away;
    sh_basis(delta[0], delta[1], delta[2], basis);
    V colour[3], gcolour[3];
    sh_colour(channels, position, delta[0], delta[1], delta[2], colour);
#pragma unroll
    for (int c = 0; c < 3; c++)  // nothing flows through the clamp at black
        gcolour[c] = colour[c] > (V)0.0f ? CHANNEL_GRADIENT(c) : (V)0.0f;
#pragma unroll
    for (int b = 0; b < SH_BANDS; b++) {
        dbasis[b] = (V)0.0f;
#pragma unroll
        for (int c = 0; c < 3; c++) {
            dbasis[b] += gcolour[c] * LOAD_ATTRIBUTE(channels, CHANNEL_ATTRIBUTES, 3 * b + c, position);
            STORE_ATTRIBUTE(USABLE(basis[b] * gcolour[c]), channel_gradients, CHANNEL_ATTRIBUTES, 3 * b + c);
        }
    }
    for (int i = 3 * SH_BANDS; i < CHANNEL_ATTRIBUTES; i++)  // bands that are not in use yet
        STORE_ATTRIBUTE((V)0.0f, channel_gradients, CHANNEL_ATTRIBUTES, i);
    sh_direction_gradient(delta[0], delta[1], delta[2], dbasis, direction);
    V along = delta[0] * direction[0] + delta[1] * direction[1] + delta[2] * direction[2];
#pragma unroll
    for (int i = 0; i < 3; i++) gworld[i] += away * (direction[i] - delta[i] * along);
#else
    for (int c = 0; c < CHANNELS; c++)
        STORE_ATTRIBUTE(USABLE(CHANNEL_GRADIENT(c)), channel_gradients, CHANNEL_ATTRIBUTES, c);
#endif

#pragma unroll
    for (int i = 0; i < 3; i++) STORE_ATTRIBUTE(USABLE(gworld[i]), geometry_gradients, GEOMETRY_ATTRIBUTES, i);
#pragma unroll
    for (int i = 0; i < 4; i++) STORE_ATTRIBUTE(USABLE(gq[i]), geometry_gradients, GEOMETRY_ATTRIBUTES, GEOMETRY_QUATS + i);
#pragma unroll
    for (int i = 0; i < 3; i++) STORE_ATTRIBUTE(USABLE(gscale[i]), geometry_gradients, GEOMETRY_ATTRIBUTES, GEOMETRY_SCALES + i);
    V gopacity = MOMENT(0) / (LN2 * OPACITY);  // p = log2 o + ...
    STORE_ATTRIBUTE(USABLE(gopacity), geometry_gradients, GEOMETRY_ATTRIBUTES, GEOMETRY_OPACITY);
    STORE_ATTRIBUTE(USABLE(gU), centre_gradients, 2, 0);
    STORE_ATTRIBUTE(USABLE(gV), centre_gradients, 2, 1);
}
