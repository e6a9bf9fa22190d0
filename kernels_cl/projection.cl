// Projection: Gaussians -> splats, footprints and depth keys of one view.
//
// Per Gaussian: move the centre into view space; drop it at z <= NEAR_PLANE or opacity < ALPHA_MIN; rotate the principal
// axes into view space; derive the quadratic form of the chosen energy and the ellipse that bounds alpha >= ALPHA_MIN;
// drop it if that touches no pixel centre; shade it; store. Channels are features or, if SH_DEGREE >= 0,
// colours and, behind them, perhaps the inverse depth and 1.

#define MEAN(axis) (LOAD_ATTRIBUTE(geometry, GEOMETRY_ATTRIBUTES, axis, position) - CAMERA_ORIGIN(axis))
#define QUAT(axis) LOAD_ATTRIBUTE(geometry, GEOMETRY_ATTRIBUTES, GEOMETRY_QUATS + axis, position)
#define SCALE(axis) LOAD_ATTRIBUTE(geometry, GEOMETRY_ATTRIBUTES, GEOMETRY_SCALES + axis, position)
#define OPACITY LOAD_ATTRIBUTE(geometry, GEOMETRY_ATTRIBUTES, GEOMETRY_OPACITY, position)
#define HALF_LOG2E 0.72134752f
#define TWO_LN2 1.38629436f
#define IN_RANGE(x) (((x) >= (V)(1.0f / MAGNITUDE_MAX)) & ((x) <= (V)MAGNITUDE_MAX))

typedef struct {
    V x, y, sxx, sxy, syy;  // {d : d' S^-1 d <= 1} around (x, y)
    V width2;               // det S / syy
    I unbounded;            // mask: no ellipse
} Ellipse;

// Unit principal axes of the Gaussians in view space: axes[3 * a + i] is component i of axis a; no numbers where the
// quaternion is zero, or out of range.
inline void view_axes(__constant const float *camera, __global const float *geometry, uint position, V *axes) {
    V w = QUAT(0), x = QUAT(1), y = QUAT(2), z = QUAT(3);
    V size = MAX(MAX(fabs(w), fabs(x)), MAX(fabs(y), fabs(z)));
    V unit = IN_RANGE(size) ? 1.0f / size : (V)NAN;  // before squares are taken, which could overflow
    w *= unit, x *= unit, y *= unit, z *= unit;
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
// The maximum of a Gaussian along a pixel's ray (paper, Eq. E; GOF's stable form). With axes q_a and scales s_a, the camera
// lies at p_a = q_a . mean / s_a in the Gaussian's own frame, the ray's direction r = ((u - cx) / fx, (v - cy) / fy, 1) is
// d_a = q_a . r / s_a, and
//   E = exp(-1/2 |p|^2 sin^2),  sin^2 = K / (L^2 + K),  L = p . d / |p|^2,  K = |p x d|^2 / |p|^4.
// The cross product keeps its digits as a product with view-space vectors,
//   (p x d)_a = s_a (q_a . (mean x r)) / (s_1 s_2 s_3),
// and is linear in the pixel and perpendicular to p: two numbers, found by Gram-Schmidt, are all there is of it.
// `mean` enters relative to its largest coordinate, scales relative to one another: both cancel, and cannot overflow.
inline Ellipse ray_form(__constant const float *camera, int width, int height, const V *mean, const V *scales,
                        const V *axes, V level, V *splat) {
    V middle = MAX(MIN(scales[0], scales[1]), MIN(MAX(scales[0], scales[1]), scales[2]));
    V smallest = MAX(MIN(MIN(scales[0], scales[1]), scales[2]), middle / RAY_SCALE_RATIO);
    V largest = MIN(MAX(MAX(scales[0], scales[1]), scales[2]), middle * RAY_SCALE_RATIO);
    V z = mean[2], farthest = MAX(MAX(fabs(mean[0]), fabs(mean[1])), z), unit = 1.0f / farthest;
    V m[3] = {mean[0] * unit, mean[1] * unit, z * unit};

    // The ray of (U, V): the centre's, or another where the centre lies outside the image.
    V u = MIN(MAX(splat[SPLAT_U], (V)0.0f), (V)width), v = MIN(MAX(splat[SPLAT_V], (V)0.0f), (V)height);
    I outside = MASK(u != splat[SPLAT_U]) | MASK(v != splat[SPLAT_V]);
    V rx = (u - CAMERA_CX) * (1.0f / CAMERA_FX), ry = (v - CAMERA_CY) * (1.0f / CAMERA_FY);
    V side[3] = {m[1] - m[2] * ry, m[2] * rx - m[0], m[0] * ry - m[1] * rx};  // m x r

    V scale[3], pp = (V)0.0f, pr = (V)0.0f, px = (V)0.0f, py = (V)0.0f, xx = (V)0.0f, xy = (V)0.0f, x0 = (V)0.0f;
    V per_largest = 1.0f / largest;
#pragma unroll
    for (int a = 0; a < 3; a++) {
        scale[a] = MIN(MAX(scales[a], smallest), largest);
        V qx = axes[3 * a], qy = axes[3 * a + 1], qz = axes[3 * a + 2];
        V w = smallest / scale[a], share = scale[a] * per_largest;
        V p = w * (qx * m[0] + qy * m[1] + qz * m[2]), pw = p * w;
        pp += p * p, pr += pw * (qx * rx + qy * ry + qz), px += pw * qx, py += pw * qy;
        V cx = share * (qy * m[2] - qz * m[1]), cy = share * (qz * m[0] - qx * m[2]);
        V c0 = share * (qx * side[0] + qy * side[1] + qz * side[2]);
        xx += cx * cx, xy += cx * cy, x0 += cx * c0;
    }
    V norm = sqrt(pp), length = MAX(sqrt(xx), (V)1e-18f), per_pp = unit / pp;
    V factor = smallest / middle * per_pp, slope = factor / length;
    V down = smallest * per_largest * unit * m[2] / (norm * length);  // |cx x cy| = middle / largest m_z |p|
    V reach = norm * MIN(farthest / smallest, (V)1e15f);              // |p|
    splat[SPLAT_U] = u;
    splat[SPLAT_V] = v;
    splat[SPLAT_A] = middle >= (V)(1.0f / MAGNITUDE_MAX) ? factor * length * (1.0f / CAMERA_FX) : (V)0.0f;
    splat[SPLAT_B] = slope * xy * (1.0f / CAMERA_FY);
    splat[SPLAT_C] = down * (1.0f / CAMERA_FY);
    splat[SPLAT_A0] = AS_FLOAT(AS_INT(slope * x0) & outside);
    splat[SPLAT_C0] = AS_FLOAT(AS_INT(down * (ry - mean[1] / z)) & outside);
    splat[SPLAT_LX] = per_pp * px * (1.0f / CAMERA_FX);
    splat[SPLAT_LY] = per_pp * py * (1.0f / CAMERA_FY);
    splat[SPLAT_L0] = outside ? per_pp * pr : 1.0f / z;
    splat[SPLAT_G] = HALF_LOG2E * reach * reach;

    // Outline of the ellipsoid (x - mean)' Sigma^-1 (x - mean) = t^2: the dual conic t^2 Sigma - mean mean', projected, in
    // units of z and as sums of squares.
    V t2 = TWO_LN2 * level, iz = 1.0f / z, nx = mean[0] * iz, ny = mean[1] * iz;
    V zz = (V)0.0f, xz = (V)0.0f, yz = (V)0.0f, fxx = (V)0.0f, fxy = (V)0.0f, fyy = (V)0.0f;
#pragma unroll
    for (int a = 0; a < 3; a++) {
        V s = scale[a] * iz, az = s * axes[3 * a + 2];
        V ux = s * axes[3 * a] - nx * az, uy = s * axes[3 * a + 1] - ny * az;
        zz += az * az, xz += ux * az, yz += uy * az;
        fxx += ux * ux, fxy += ux * uy, fyy += uy * uy;
    }
    V depth = 1.0f - t2 * zz;  // > 0 exactly when the ellipsoid lies wholly in front of the camera
    V i = 1.0f / depth, s = t2 * i * i;
    Ellipse e;
    // Closer to 0, or far outside the image, an ellipse's numbers lose too many digits.
    e.unbounded = (depth <= (V)0.1f) | (MAX(largest, farthest) > 1e5f * z);
    e.x = CAMERA_FX * (nx - t2 * xz * i) + CAMERA_CX;
    e.y = CAMERA_FY * (ny - t2 * yz * i) + CAMERA_CY;
    e.sxx = CAMERA_FX * CAMERA_FX * s * (fxx * depth + t2 * xz * xz);
    e.sxy = CAMERA_FX * CAMERA_FY * s * (fxy * depth + t2 * xz * yz);
    e.syy = CAMERA_FY * CAMERA_FY * s * (fyy * depth + t2 * yz * yz);
    // det S = t^4 det Sigma (mean' Sigma^-1 mean - t^2) / depth^3, in pixels
    V area = CAMERA_FX * CAMERA_FY * t2 * (middle * iz) * (largest * iz) * i;
    V above = norm * farthest * iz, below = smallest * iz;
    e.width2 = area * (area / e.syy) * ((above * above - t2 * below * below) * i);
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

// Sigma' = J Sigma J' + dilation as a sum of products of the axes' images (paper, Preliminaries; J with the reference
// rasterizer's clamp).
typedef struct {
    V jx, jy;            // clamped slopes of the centre
    V scale[3];          // the scales, as far as they matter
    V ux[3], uy[3];      // images of the unit axes
    V xx, xy, yy;        // Sigma'
    V determinant;
} Spread;

inline Spread ewa_spread(__constant const float *camera, int width, int height, const V *mean, const V *scales,
                         const V *axes) {
    Spread e;
    float fx = CAMERA_FX, fy = CAMERA_FY;
    Frustum f = frustum(camera, width, height);
    V iz = 1.0f / mean[2], most = EWA_DEVIATION_MAX / max(fx, fy) * mean[2];
    e.jx = MIN(MAX(mean[0] * iz, (V)f.low_x), (V)f.high_x);
    e.jy = MIN(MAX(mean[1] * iz, (V)f.low_y), (V)f.high_y);
    e.xx = (V)EWA_DILATION, e.xy = (V)0.0f, e.yy = (V)EWA_DILATION;
#pragma unroll
    for (int a = 0; a < 3; a++) {
        e.scale[a] = MIN(scales[a], most);
        e.ux[a] = fx * iz * (axes[3 * a] - e.jx * axes[3 * a + 2]);
        e.uy[a] = fy * iz * (axes[3 * a + 1] - e.jy * axes[3 * a + 2]);
        V vx = e.scale[a] * e.ux[a], vy = e.scale[a] * e.uy[a];
        e.xx += vx * vx, e.xy += vx * vy, e.yy += vy * vy;
    }
    // xx yy - xy^2 as a sum of squares (Cauchy-Binet): no cancellation for needles.
    e.determinant = EWA_DILATION * (e.xx + e.yy - EWA_DILATION);
#pragma unroll
    for (int a = 0; a < 3; a++) {
        int b = (a + 1) % 3;
        V area = e.scale[a] * e.scale[b] * (e.ux[a] * e.uy[b] - e.ux[b] * e.uy[a]);
        e.determinant += area * area;
    }
    return e;
}

inline Ellipse ewa_form(__constant const float *camera, int width, int height, const V *mean, const V *scale,
                        const V *axes, V level, V *splat) {
    Spread spread = ewa_spread(camera, width, height, mean, scale, axes);
    V xx = spread.xx, xy = spread.xy, yy = spread.yy, determinant = spread.determinant;
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

__kernel void project(uint count, int width, int height,
                      __constant const float *camera,  // [24]
                      __global const float *geometry,  // [blocks,GEOMETRY_ATTRIBUTES,BLOCK]
                      __global const float *channels,  // [blocks,CHANNEL_ATTRIBUTES,BLOCK]
                      __global float *splats,          // [K,SPLAT]
                      __global float *footprints,      // [K,FOOTPRINT_FLOATS]
                      __global uint *areas,            // [K], of the tile rectangles, in tiles
                      __global uint *depth_keys) {     // [K]
    uint position = get_global_id(0) * LANES;
    if (position >= count) return;

    V world[3] = {MEAN(0), MEAN(1), MEAN(2)}, mean[3];
#pragma unroll
    for (int i = 0; i < 3; i++)
        mean[i] = CAMERA_VIEW(i, 0) * world[0] + CAMERA_VIEW(i, 1) * world[1] + CAMERA_VIEW(i, 2) * world[2] +
                  CAMERA_VIEW(i, 3);
    V opacity = OPACITY;
    I visible = MASK(mean[2] > (V)NEAR_PLANE) & MASK(opacity >= (V)ALPHA_MIN);
#pragma unroll
    for (int i = 0; i < 3; i++) visible &= MASK(fabs(mean[i]) <= (V)COORDINATE_MAX);

    union {
        V v[SPLAT];
        float f[SPLAT * LANES];
    } splat;
    union {
        V v[FOOTPRINT_FLOATS];
        float f[FOOTPRINT_FLOATS * LANES];
    } footprint;
    union {
        U v;
        uint u[LANES];
    } key, area;
    if (ANY(visible)) {
        V axes[9], scale[3] = {SCALE(0), SCALE(1), SCALE(2)};
        view_axes(camera, geometry, position, axes);
#pragma unroll
        for (int a = 0; a < 3; a++) visible &= MASK(scale[a] <= (V)MAGNITUDE_MAX);
        V log2_opacity = MIN(log2(opacity), (V)0.0f);
        V level = log2_opacity - (V)LOG2_ALPHA_MIN;  // alpha >= ALPHA_MIN exactly while the quadratic form >= -level
        splat.v[SPLAT_U] = CAMERA_FX * mean[0] / mean[2] + CAMERA_CX;
        splat.v[SPLAT_V] = CAMERA_FY * mean[1] / mean[2] + CAMERA_CY;
        splat.v[SPLAT_LOG2_OPACITY] = log2_opacity;
#if RAY
        Ellipse e = ray_form(camera, width, height, mean, scale, axes, level, splat.v);
#else
        splat.v[SPLAT_DEPTH] = mean[2];
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
        columns = tile_range(columns), rows = tile_range(rows);
        footprint.v[FOOTPRINT_TILES_X] = AS_FLOAT(columns);
        footprint.v[FOOTPRINT_TILES_Y] = AS_FLOAT(rows);
        area.v = ((columns >> 16) - (columns & 0xffffu) + 1) * ((rows >> 16) - (rows & 0xffffu) + 1);
    }
#if CHANNELS > 0
    if (ANY(visible)) {
#if SH_DEGREE >= 0
        V x = world[0] - CAMERA_CENTRE(0), y = world[1] - CAMERA_CENTRE(1), z = world[2] - CAMERA_CENTRE(2);
        V inverse = 1.0f / sqrt(x * x + y * y + z * z);
        sh_colour(channels, position, x * inverse, y * inverse, z * inverse, splat.v + SPLAT_CHANNELS);
#if CHANNELS > 3
        splat.v[SPLAT_CHANNELS + 3] = 1.0f / mean[2];
#endif
#if CHANNELS > 4
        splat.v[SPLAT_CHANNELS + 4] = (V)1.0f;
#endif
#else
        for (int c = 0; c < CHANNELS; c++)
            splat.v[SPLAT_CHANNELS + c] = LOAD_ATTRIBUTE(channels, CHANNEL_ATTRIBUTES, c, position);
#endif
    }
#endif

    key.v = visible ? AS_UINT(mean[2]) : (U)NOT_VISIBLE;
    for (uint lane = 0; lane < LANES && position + lane < count; lane++) {
        depth_keys[position + lane] = key.u[lane];
        if (key.u[lane] == NOT_VISIBLE) continue;
        __global float *s = splats + (size_t)SPLAT * (position + lane);
        for (int i = 0; i < SPLAT_CHANNELS + CHANNELS; i++) s[i] = splat.f[i * LANES + lane];
        __global float *f = footprints + (size_t)FOOTPRINT_FLOATS * (position + lane);
        for (int i = 0; i < FOOTPRINT_FLOATS; i++) f[i] = footprint.f[i * LANES + lane];
        areas[position + lane] = area.u[lane];
    }
}
