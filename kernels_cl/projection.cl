// Projection: Gaussians -> splats, footprints and depth keys of one view.
//
// Per Gaussian: move the centre into view space; drop it at z <= NEAR_PLANE or opacity < ALPHA_MIN; rotate the principal
// axes into view space; derive the quadratic form of the chosen energy and the ellipse that bounds alpha >= ALPHA_MIN;
// drop it if that touches no pixel centre; shade it; store.

#define MEAN(axis) LOAD_ATTRIBUTE(geometry, GEOMETRY, axis, position)
#define QUAT(axis) LOAD_ATTRIBUTE(geometry, GEOMETRY, 3 + axis, position)
#define SCALE(axis) LOAD_ATTRIBUTE(geometry, GEOMETRY, 7 + axis, position)
#define OPACITY LOAD_ATTRIBUTE(geometry, GEOMETRY, 10, position)
#define HALF_LOG2E 0.72134752f
#define TWO_LN2 1.38629436f

typedef struct {
    V x, y, sxx, sxy, syy;  // {d : d' S^-1 d <= 1} around (x, y)
    V width2;               // det S / syy
    I unbounded;            // mask: no ellipse
} Ellipse;

// Unit principal axes of the Gaussians in view space: axes[3 * a + i] is component i of axis a.
inline void view_axes(__constant const float *camera, __global const float *geometry, uint position, V *axes) {
    V w = QUAT(0), x = QUAT(1), y = QUAT(2), z = QUAT(3);
    V s = 2.0f / (w * w + x * x + y * y + z * z);
    V world[9] = {1.0f - s * (y * y + z * z), s * (x * y + w * z),        s * (x * z - w * y),
                  s * (x * y - w * z),        1.0f - s * (x * x + z * z), s * (y * z + w * x),
                  s * (x * z + w * y),        s * (y * z - w * x),        1.0f - s * (x * x + y * y)};
#pragma unroll
    for (int a = 0; a < 3; a++)
#pragma unroll
        for (int i = 0; i < 3; i++)
            axes[3 * a + i] = CAMERA_VIEW(i, 0) * world[3 * a] + CAMERA_VIEW(i, 1) * world[3 * a + 1] +
                              CAMERA_VIEW(i, 2) * world[3 * a + 2];
}

#if RAY
// The maximum of a Gaussian along a pixel's ray (paper, Eq. E; GOF's stable form). With axes q_a, scales s_a, the ray
// direction in the Gaussian's own frame is linear in the pixel: direction_a = q_a . r / s_a, and
//   E = exp(-1/2 |p x direction|^2 / |direction|^2),   p_a = q_a . mean / s_a.
// Scales enter p and direction relative to the smallest one, which cancels in the quotient and cannot overflow.
// The cross product is linear in d, for it vanishes at the projected centre: with e_x, e_y the changes of r per pixel,
//   (p x direction)_a = s_a (q_a . (mean x (e_x dx + e_y dy))) / (s_1 s_2 s_3),
// hence Q = |cx dx + cy dy|^2 up to a factor, in a form without cancellation.
inline Ellipse ray_form(__constant const float *camera, const V *mean, const V *scale, const V *axes, V level, V *splat) {
    V smallest = MIN(MIN(scale[0], scale[1]), scale[2]), largest = MAX(MAX(scale[0], scale[1]), scale[2]);
    V middle = MAX(MIN(scale[0], scale[1]), MIN(MAX(scale[0], scale[1]), scale[2]));
    V z = mean[2];
    V p[3], gx[3], gy[3], cx[3], cy[3], plane[3];
#pragma unroll
    for (int a = 0; a < 3; a++) {
        V w = smallest / scale[a], v = scale[a] / largest;
        V along = axes[3 * a] * mean[0] + axes[3 * a + 1] * mean[1] + axes[3 * a + 2] * mean[2];
        p[a] = w * along;
        gx[a] = w * axes[3 * a] * (1.0f / CAMERA_FX);
        gy[a] = w * axes[3 * a + 1] * (1.0f / CAMERA_FY);
        cx[a] = v * (axes[3 * a + 1] * z - axes[3 * a + 2] * mean[1]) * (1.0f / CAMERA_FX);
        cy[a] = v * (axes[3 * a + 2] * mean[0] - axes[3 * a] * z) * (1.0f / CAMERA_FY);
        int b = (a + 1) % 3, c = (a + 2) % 3;
        plane[a] = (scale[b] / largest) * (scale[c] / largest) * along;  // cx x cy = z plane / (FX FY)
    }
    V pp = p[0] * p[0] + p[1] * p[1] + p[2] * p[2];
    V centre = z * z / pp;  // 1 / |direction|^2 at the centre
    V length = sqrt(cx[0] * cx[0] + cx[1] * cx[1] + cx[2] * cx[2]);
    V factor = sqrt((V)HALF_LOG2E / pp) * z / middle;
    splat[SPLAT_A] = factor * length;
    splat[SPLAT_B] = factor * (cx[0] * cy[0] + cx[1] * cy[1] + cx[2] * cy[2]) / length;
    splat[SPLAT_C] = factor * z * (1.0f / (CAMERA_FX * CAMERA_FY)) / length *
                     sqrt(plane[0] * plane[0] + plane[1] * plane[1] + plane[2] * plane[2]);
    splat[SPLAT_LX] = centre * (p[0] * gx[0] + p[1] * gx[1] + p[2] * gx[2]) / z;
    splat[SPLAT_LY] = centre * (p[0] * gy[0] + p[1] * gy[1] + p[2] * gy[2]) / z;
    splat[SPLAT_MXX] = centre * (gx[0] * gx[0] + gx[1] * gx[1] + gx[2] * gx[2]);
    splat[SPLAT_MXY] = centre * (gx[0] * gy[0] + gx[1] * gy[1] + gx[2] * gy[2]);
    splat[SPLAT_MYY] = centre * (gy[0] * gy[0] + gy[1] * gy[1] + gy[2] * gy[2]);
#if POINTS
    splat[SPLAT_STEEPNESS] = MIN(HALF_LOG2E / centre / smallest / smallest, (V)1e30f);  // |direction|^2 at the centre
#endif

    // Outline of the ellipsoid (x - mean)' Sigma^-1 (x - mean) = t^2: the dual conic t^2 Sigma - mean mean', projected.
    V t2 = TWO_LN2 * level;
    V xx = (V)0.0f, xy = (V)0.0f, yy = (V)0.0f, xz = (V)0.0f, yz = (V)0.0f, zz = (V)0.0f;
    V fxx = (V)0.0f, fxy = (V)0.0f, fyy = (V)0.0f;  // variances of (z x - mean_x z) and (z y - mean_y z)
#pragma unroll
    for (int a = 0; a < 3; a++) {
        V ax = scale[a] * axes[3 * a], ay = scale[a] * axes[3 * a + 1], az = scale[a] * axes[3 * a + 2];
        V ux = z * ax - mean[0] * az, uy = z * ay - mean[1] * az;
        xx += ax * ax, xy += ax * ay, yy += ay * ay, xz += ax * az, yz += ay * az, zz += az * az;
        fxx += ux * ux, fxy += ux * uy, fyy += uy * uy;
    }
    V depth = z * z - t2 * zz;  // > 0 exactly when the ellipsoid lies wholly in front of the camera
    V i = 1.0f / depth, s = t2 * i * i;
    Ellipse e;
    e.unbounded = depth <= 0.1f * z * z;  // closer to 0, an ellipse's numbers lose too many digits
    e.x = CAMERA_FX * (mean[0] * z - t2 * xz) * i + CAMERA_CX;
    e.y = CAMERA_FY * (mean[1] * z - t2 * yz) * i + CAMERA_CY;
    e.sxx = CAMERA_FX * CAMERA_FX * s * (fxx - t2 * (xx * zz - xz * xz));
    e.sxy = CAMERA_FX * CAMERA_FY * s * (fxy - t2 * (xy * zz - xz * yz));
    e.syy = CAMERA_FY * CAMERA_FY * s * (fyy - t2 * (yy * zz - yz * yz));
    // det S = t^4 det Sigma (mean' Sigma^-1 mean - t^2) / depth^3, in pixels
    V area = CAMERA_FX * CAMERA_FY * t2 * middle * largest * i;
    e.width2 = area * area * (pp - t2 * smallest * smallest) * i / e.syy;
    return e;
}
#else
typedef struct {
    float low_x, high_x, low_y, high_y;
} Frustum;

// Bounds of x / z and y / z inside the Jacobian: the image's frustum, widened by a share of its half extent.
inline Frustum frustum(__constant const float *camera, int width, int height) {
    float margin_x = EWA_FRUSTUM_MARGIN * 0.5f * width / CAMERA_FX;
    float margin_y = EWA_FRUSTUM_MARGIN * 0.5f * height / CAMERA_FY;
    Frustum f = {-CAMERA_CX / CAMERA_FX - margin_x, (width - CAMERA_CX) / CAMERA_FX + margin_x,
                 -CAMERA_CY / CAMERA_FY - margin_y, (height - CAMERA_CY) / CAMERA_FY + margin_y};
    return f;
}

// EWA splatting: Sigma' = J Sigma J' + dilation (paper, Preliminaries; J with the reference rasterizer's clamp).
inline Ellipse ewa_form(__constant const float *camera, int width, int height, const V *mean, const V *scale,
                        const V *axes, V level, V *splat) {
    float fx = CAMERA_FX, fy = CAMERA_FY;
    Frustum f = frustum(camera, width, height);
    V iz = 1.0f / mean[2];
    V jx = MIN(MAX(mean[0] * iz, (V)f.low_x), (V)f.high_x), jy = MIN(MAX(mean[1] * iz, (V)f.low_y), (V)f.high_y);
    V xx = (V)EWA_DILATION, xy = (V)0.0f, yy = (V)EWA_DILATION, ux[3], uy[3];
#pragma unroll
    for (int a = 0; a < 3; a++) {
        V s = scale[a] * iz;
        ux[a] = fx * s * (axes[3 * a] - jx * axes[3 * a + 2]);
        uy[a] = fy * s * (axes[3 * a + 1] - jy * axes[3 * a + 2]);
        xx += ux[a] * ux[a], xy += ux[a] * uy[a], yy += uy[a] * uy[a];
    }
    // xx yy - xy^2 as a sum of squares (Cauchy-Binet): no cancellation for needles.
    V determinant = EWA_DILATION * (xx + yy - EWA_DILATION);
#pragma unroll
    for (int a = 0; a < 3; a++) {
        int b = (a + 1) % 3;
        V area = ux[a] * uy[b] - ux[b] * uy[a];
        determinant += area * area;
    }
    V down = sqrt((V)HALF_LOG2E / yy), across = down / sqrt(determinant);
    splat[SPLAT_A] = across * yy;
    splat[SPLAT_B] = -across * xy;
    splat[SPLAT_C] = down;
    Ellipse e;
    V t2 = TWO_LN2 * level;
    e.unbounded = (I)0;
    e.x = splat[SPLAT_U];
    e.y = splat[SPLAT_V];
    e.sxx = t2 * xx;
    e.sxy = t2 * xy;
    e.syy = t2 * yy;
    e.width2 = t2 * determinant / yy;
    return e;
}
#endif

// First | last << 16 of the pixels whose centres lie in [centre - extent, centre + extent]; clears `visible` if none.
inline U pixel_range(V centre, V extent, int pixels, I *visible) {
    V low = MAX(centre - extent - (0.5f + FOOTPRINT_MARGIN), (V)-1.0f);
    V high = MIN(centre + extent - (0.5f - FOOTPRINT_MARGIN), (V)(pixels - 1));
    low = MIN(low, (V)pixels);
    high = MAX(high, (V)-1.0f);
    I first = MAX(TO_INT(ceil(low)), (I)0), last = TO_INT(floor(high));
    *visible &= MASK(first <= last);
    return AS_UINT(first) | (AS_UINT(MAX(last, (I)0)) << 16);
}

// The same of the tiles that hold these pixels.
inline U tile_range(U pixels) { return (pixels & 0xffffu) / TILE | ((pixels >> 16) / TILE << 16); }

__kernel void project(uint count, int width, int height, __constant const float *camera,
                      __global const float *geometry,
                      __global const float *channels,  // SH coefficients if SH_DEGREE >= 0, else features
                      __global float *splats, __global float *footprints, __global uint *depth_keys) {
    uint position = get_global_id(0) * LANES;
    if (position >= count) return;

    V world[3] = {MEAN(0), MEAN(1), MEAN(2)}, mean[3];
#pragma unroll
    for (int i = 0; i < 3; i++)
        mean[i] = CAMERA_VIEW(i, 0) * world[0] + CAMERA_VIEW(i, 1) * world[1] + CAMERA_VIEW(i, 2) * world[2] +
                  CAMERA_VIEW(i, 3);
    V opacity = OPACITY;
    I visible = MASK(mean[2] > (V)NEAR_PLANE) & MASK(opacity >= (V)ALPHA_MIN);

    union {
        V v[SPLAT];
        float f[SPLAT * LANES];
    } splat;
    union {
        V v[FOOTPRINT];
        float f[FOOTPRINT * LANES];
    } footprint;
    if (ANY(visible)) {
        V axes[9], scale[3] = {SCALE(0), SCALE(1), SCALE(2)};
        view_axes(camera, geometry, position, axes);
        V log2_opacity = log2(opacity);
        V level = log2_opacity - (V)LOG2_ALPHA_MIN;  // alpha >= ALPHA_MIN exactly while the quadratic form >= -level
        splat.v[SPLAT_U] = CAMERA_FX * mean[0] / mean[2] + CAMERA_CX;
        splat.v[SPLAT_V] = CAMERA_FY * mean[1] / mean[2] + CAMERA_CY;
        splat.v[SPLAT_LOG2_OPACITY] = log2_opacity;
        splat.v[SPLAT_DEPTH] = mean[2];
#if RAY
        Ellipse e = ray_form(camera, mean, scale, axes, level, splat.v);
#else
        Ellipse e = ewa_form(camera, width, height, mean, scale, axes, level, splat.v);
#endif
        visible &= MASK(splat.v[SPLAT_A] > (V)0.0f);  // false for what is not a number, as without a rotation
        e.sxx = MAX(e.sxx, (V)1e-12f);
        e.syy = MAX(e.syy, (V)1e-12f);
        V extent_x = e.unbounded ? (V)INFINITY : sqrt(e.sxx), extent_y = e.unbounded ? (V)INFINITY : sqrt(e.syy);
        V x = e.unbounded ? (V)0.0f : e.x, y = e.unbounded ? (V)0.0f : e.y;
        U columns = pixel_range(x, extent_x, width, &visible), rows = pixel_range(y, extent_y, height, &visible);
        footprint.v[FOOTPRINT_X] = x;
        footprint.v[FOOTPRINT_Y] = y;
        footprint.v[FOOTPRINT_SLOPE] = e.sxy / e.syy;
        footprint.v[FOOTPRINT_Y_EXTREME] = e.sxy / sqrt(e.sxx);
        footprint.v[FOOTPRINT_INVERSE_SYY] = e.unbounded ? (V)0.0f : 1.0f / e.syy;
        footprint.v[FOOTPRINT_WIDTH2] = MAX(e.width2, (V)0.0f);
        footprint.v[FOOTPRINT_TILES_X] = AS_FLOAT(tile_range(columns));
        footprint.v[FOOTPRINT_TILES_Y] = AS_FLOAT(tile_range(rows));
    }
#if CHANNELS > 0
    if (ANY(visible)) {
#if SH_DEGREE >= 0
        V x = world[0] - CAMERA_CENTRE(0), y = world[1] - CAMERA_CENTRE(1), z = world[2] - CAMERA_CENTRE(2);
        V inverse = 1.0f / sqrt(x * x + y * y + z * z);
        sh_colour(channels, position, x * inverse, y * inverse, z * inverse, splat.v + SPLAT_CHANNELS);
#else
        for (int c = 0; c < CHANNELS; c++)
            splat.v[SPLAT_CHANNELS + c] = LOAD_ATTRIBUTE(channels, CHANNEL_ATTRIBUTES, c, position);
#endif
    }
#endif

    union {
        U v;
        uint u[LANES];
    } key;
    key.v = visible ? AS_UINT(mean[2]) : (U)NOT_VISIBLE;
    for (uint lane = 0; lane < LANES && position + lane < count; lane++) {
        depth_keys[position + lane] = key.u[lane];
        if (key.u[lane] == NOT_VISIBLE) continue;
        __global float *s = splats + (size_t)SPLAT * (position + lane);
        for (int i = 0; i < SPLAT_CHANNELS + CHANNELS; i++) s[i] = splat.f[i * LANES + lane];
        __global float *f = footprints + (size_t)FOOTPRINT * (position + lane);
        for (int i = 0; i < FOOTPRINT; i++) f[i] = footprint.f[i * LANES + lane];
    }
}
