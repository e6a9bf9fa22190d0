// Blending of one Gaussian into 16 pixels of a row (cpu style) or one pixel (gpu style): the arithmetic of all blending
// kernels.
//
// The sign bit of T marks finished pixels: it is set when the next Gaussian would bring T below TRANSMITTANCE_MIN. A
// negative T gives no weight and stays as it is, since it is below TRANSMITTANCE_MIN too; |T| is the pixel's final
// transmittance. No branch is needed.
//
// The exponent is evaluated in two steps:
//   row_terms        the terms of dy; the cpu style computes them for the 16 rows of a tile at once
//   log2_alpha       log2 alpha at the offset (dx, dy) from a splat's centre, below LOG2_ALPHA_MIN where it does not
//                    touch the pixel, and its depth there, at which it counts behind the near plane only; `terms` points
//                    to the row's first term, the others follow LANES apart
//   log2_alpha_most  an upper bound of log2 alpha in a row, between dx = low and dx = high

#define TERM(i) terms[LANES * (i)]

// The value between A low + B dy and A high + B dy that is nearest to 0. Rounding keeps order, so that no pixel between
// them computes one that is nearer.
inline V nearest_to_zero(V low, V high) { return MAX(low, MIN(high, (V)0.0f)); }

#if RAY
#define ROW_TERMS 3
#define IN_FRONT(depth) ((depth) > (V)NEAR_PLANE)
inline void row_terms(V dy, const float *s, V *terms) {
    V down = s[SPLAT_C] * dy + s[SPLAT_C0];
    terms[0] = s[SPLAT_B] * dy + s[SPLAT_A0];
    terms[1] = down * down;
    terms[2] = s[SPLAT_LY] * dy + s[SPLAT_L0];
}

// The exponent of rays of which K = across^2 + down2 and L = along; their N, and the depth t*. Whatever the numbers are, it
// is at most LOG2_OPACITY, or not a number.
inline V ray_exponent(V across, V down2, V along, const float *s, V *norm, V *depth) {
    V miss = across * across + down2;
    *norm = along * along + miss;
    V inverse = 1.0f / *norm;
    *depth = along * inverse;
    return s[SPLAT_LOG2_OPACITY] - s[SPLAT_G] * (miss * inverse);
}

inline V log2_alpha(V dx, const float *terms, const float *s, V *depth) {
    V norm;
    return ray_exponent(s[SPLAT_A] * dx + TERM(0), TERM(1), s[SPLAT_LX] * dx + TERM(2), s, &norm, depth);
}

// K is smallest where its first square is, and L^2, being convex in dx, is largest at an end; the margins cover rounding.
inline V log2_alpha_most(V low, V high, const V *terms, const float *s) {
    V nearest = nearest_to_zero(s[SPLAT_A] * low + terms[0], s[SPLAT_A] * high + terms[0]);
    V miss = nearest * nearest + terms[1];
    V along = MAX(fabs(s[SPLAT_LX] * low + terms[2]), fabs(s[SPLAT_LX] * high + terms[2])) + 1e-6f * fabs(terms[2]);
    return s[SPLAT_LOG2_OPACITY] + 1e-3f - s[SPLAT_G] * (miss / (1.00001f * along * along + miss));
}
#else
#define ROW_TERMS 2
#define IN_FRONT(depth) (I)-1  // projection drops the others
inline void row_terms(V dy, const float *s, V *terms) {
    V down = s[SPLAT_C] * dy;
    terms[0] = s[SPLAT_B] * dy;
    terms[1] = s[SPLAT_LOG2_OPACITY] - down * down;
}

inline V log2_alpha(V dx, const float *terms, const float *s, V *depth) {
    V across = s[SPLAT_A] * dx + TERM(0);
    *depth = (V)s[SPLAT_DEPTH];
    return TERM(1) - across * across;
}

inline V log2_alpha_most(V low, V high, const V *terms, const float *s) {
    V nearest = nearest_to_zero(s[SPLAT_A] * low + terms[0], s[SPLAT_A] * high + terms[0]);
    return terms[1] - nearest * nearest;
}
#endif

#if LANES == 16
// Mask of the tile's rows in which a splat can touch a pixel; dx are the offsets of the columns.
inline int16 reached_rows(float16 dx, const float16 *terms, const float *s) {
    return log2_alpha_most((float16)dx.s0, (float16)dx.sf, terms, s) >= (float16)LOG2_ALPHA_MIN;
}
#endif

// 2^exponent, at most ALPHA_MAX, and 0 below ALPHA_MIN, for NaN, and before the near plane. No exponent is positive.
inline V bounded_alpha(V exponent, V depth) {
    V alpha = MIN(exp2_polynomial(exponent), (V)ALPHA_MAX);
    return AS_FLOAT(AS_INT(alpha) & MASK((exponent >= (V)LOG2_ALPHA_MIN) & IN_FRONT(depth)));
}

// Blend one splat: returns its weight alpha * T, and moves T on.
inline V blend(V exponent, V depth, V *transmittance) {
    V before = *transmittance;
    V weight = bounded_alpha(exponent, depth) * before;
    V after = before - weight;
    I stop = MASK(after < (V)TRANSMITTANCE_MIN);
    *transmittance = stop ? AS_FLOAT(AS_INT(before) | SIGN_BIT) : after;
    return stop ? (V)0.0f : weight;
}
