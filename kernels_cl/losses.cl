// The loss of 3DGS, (1 - w) L1 + w (1 - SSIM), and its gradient with respect to the image.
//
// Images are planes of padded rows of `stride` floats: the first MARGIN * CHANNELS and all behind the last pixel are zero,
// so that the 11-tap window (zero padding, as in 3DGS) runs over interleaved channels without a special case. In vectors of
// LANES of the `values` = W CHANNELS of a row:
//   pad_image       image -> padded rows
//   window_rows     x, y, xx, yy, xy: windowed along the row
//   compare         windowed down the columns: SSIM, the loss of each vector, and dSSIM / d(mean x, E[xx], E[xy])
//   window_maps     those three: windowed along the row
//   loss_gradient   windowed down the columns (the window is its own adjoint): dL/dimage

#define MARGIN (SSIM_WINDOW / 2)

// The rows of the image (cpu style: less work per work-item costs more in launches), or its values (gpu style).
#if LANES == 16
#define PARTS 1
#else
#define PARTS values
#endif
#define ROW                                   \
    uint row = get_global_id(0) / PARTS;      \
    if (row >= height) return;                \
    size_t plane = (size_t)height * stride;
// `column` counts values, not pixels.
#define FOR_VALUES for (uint column = get_global_id(0) % PARTS * LANES; column < values; column += PARTS * LANES)
#define HERE ((size_t)row * stride + MARGIN * CHANNELS + column)
// Taps of the window down the columns that lie inside the image.
#define FOR_ROWS                                                          \
    for (uint k = row < MARGIN ? MARGIN - row : 0; k < min((uint)SSIM_WINDOW, height + MARGIN - row); k++)
#define THERE (here + ((size_t)k - MARGIN) * stride)

#if LANES == 16
#define LOAD(array, index) vload16(0, (array) + (index))
#define STORE(value, array, index) vstore16(value, 0, (array) + (index))
#define LANE_INDEX ((int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15))
#define SUM(v) sum16(v)
#else
#define LOAD(array, index) (array)[index]
#define STORE(value, array, index) (array)[index] = (value)
#define LANE_INDEX 0
#define SUM(v) (v)
#endif
#define INSIDE MASK((I)(int)column + LANE_INDEX < (I)(int)values)

__kernel void pad_image(uint height, uint values, uint stride,
                        __global const float *image,  // [H,W,CHANNELS]
                        __global float *padded) {     // [H,stride]
    ROW
    FOR_VALUES {
        size_t here = HERE, pixels = (size_t)row * values + column;
        if (column + LANES <= values) STORE(LOAD(image, pixels), padded, here);
        else
            for (uint i = 0; i < values - column; i++) padded[here + i] = image[pixels + i];
    }
}

__kernel void window_rows(uint height, uint values, uint stride,
                          __constant const float *window,  // [SSIM_WINDOW]
                          __global const float *x,         // [H,stride]
                          __global const float *y,         // [H,stride]
                          __global float *moments) {       // [5,H,stride]
    ROW
    FOR_VALUES {
        size_t here = HERE;
        V mx = (V)0.0f, my = (V)0.0f, xx = (V)0.0f, yy = (V)0.0f, xy = (V)0.0f;
        for (int k = 0; k < SSIM_WINDOW; k++) {
            size_t there = here + (k - MARGIN) * CHANNELS;
            V a = LOAD(x, there), b = LOAD(y, there), wa = window[k] * a, wb = window[k] * b;
            mx += wa, my += wb, xx += wa * a, yy += wb * b, xy += wa * b;
        }
        STORE(mx, moments, here);
        STORE(my, moments, plane + here);
        STORE(xx, moments, 2 * plane + here);
        STORE(yy, moments, 3 * plane + here);
        STORE(xy, moments, 4 * plane + here);
    }
}

__kernel void compare(uint height, uint values, uint stride, float ssim_weight,
                      __constant const float *window,  // [SSIM_WINDOW]
                      __global const float *x,         // [H,stride]
                      __global const float *y,         // [H,stride]
                      __global const float *moments,   // [5,H,stride]
                      __global float *maps,            // [3,H,stride]
                      __global float *losses) {        // [H,ceil(values / LANES)]
    ROW
    FOR_VALUES {
        size_t here = HERE;
        V mx = (V)0.0f, my = (V)0.0f, xx = (V)0.0f, yy = (V)0.0f, xy = (V)0.0f;
        FOR_ROWS {
            size_t there = THERE;
            mx += window[k] * LOAD(moments, there);
            my += window[k] * LOAD(moments, plane + there);
            xx += window[k] * LOAD(moments, 2 * plane + there);
            yy += window[k] * LOAD(moments, 3 * plane + there);
            xy += window[k] * LOAD(moments, 4 * plane + there);
        }
        V a = 2.0f * mx * my + SSIM_C1, b = 2.0f * (xy - mx * my) + SSIM_C2;
        V d = mx * mx + my * my + SSIM_C1, e = (xx - mx * mx) + (yy - my * my) + SSIM_C2;
        V inverse = 1.0f / (d * e), ssim = a * b * inverse;
        I inside = INSIDE;
        V by_xx = -ssim * d * inverse, by_xy = 2.0f * a * inverse;
        V by_mean = 2.0f * my * inverse * (b - a) + 2.0f * mx * ssim * (d - e) * inverse;
        STORE(inside ? by_mean : (V)0.0f, maps, here);
        STORE(inside ? by_xx : (V)0.0f, maps, plane + here);
        STORE(inside ? by_xy : (V)0.0f, maps, 2 * plane + here);
        V loss = (1.0f - ssim_weight) * fabs(LOAD(x, here) - LOAD(y, here)) + ssim_weight * (1.0f - ssim);
        losses[row * ((values + LANES - 1) / LANES) + column / LANES] = SUM(inside ? loss : (V)0.0f);
    }
}

__kernel void window_maps(uint height, uint values, uint stride,
                          __constant const float *window,  // [SSIM_WINDOW]
                          __global const float *maps,      // [3,H,stride]
                          __global float *windowed) {      // [3,H,stride]
    ROW
    FOR_VALUES {
        size_t here = HERE;
        for (int map = 0; map < 3; map++) {
            V sum = (V)0.0f;
            for (int k = 0; k < SSIM_WINDOW; k++)
                sum += window[k] * LOAD(maps, map * plane + here + (k - MARGIN) * CHANNELS);
            STORE(sum, windowed, map * plane + here);
        }
    }
}

__kernel void loss_gradient(uint height, uint values, uint stride, float ssim_weight,
                            __constant const float *window,  // [SSIM_WINDOW]
                            __global const float *x,         // [H,stride]
                            __global const float *y,         // [H,stride]
                            __global const float *windowed,  // [3,H,stride]
                            __global float *gradient) {      // [H,W,CHANNELS]
    ROW
    FOR_VALUES {
        size_t here = HERE;
        V by_mean = (V)0.0f, by_xx = (V)0.0f, by_xy = (V)0.0f;
        FOR_ROWS {
            size_t there = THERE;
            by_mean += window[k] * LOAD(windowed, there);
            by_xx += window[k] * LOAD(windowed, plane + there);
            by_xy += window[k] * LOAD(windowed, 2 * plane + there);
        }
        V a = LOAD(x, here), b = LOAD(y, here);
        V sign = a > b ? (V)1.0f : (a < b ? (V)-1.0f : (V)0.0f);
        V ssim = by_mean + 2.0f * a * by_xx + b * by_xy;
        union {
            V v;
            float f[LANES];
        } lane;
        lane.v = ((1.0f - ssim_weight) * sign - ssim_weight * ssim) * (1.0f / ((float)height * values));
        size_t pixels = (size_t)row * values + column;
        if (column + LANES <= values) STORE(lane.v, gradient, pixels);
        else
            for (uint i = 0; i < values - column; i++) gradient[pixels + i] = lane.f[i];
    }
}
