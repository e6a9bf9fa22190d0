// What one Gaussian does to 16 pixels of a row (cpu style) or to one pixel (gpu style): the arithmetic that both
// blending kernels share.
//
// Transmittance carries its own end: once the next Gaussian would bring T below TRANSMITTANCE_MIN, T's sign bit is set.
// A negative T takes no more weight, and |T| is the pixel's final transmittance. No branch is needed.

// log2 alpha of a splat at offset (dx, dy) from its centre, below LOG2_ALPHA_MIN where it does not touch the pixel; and
// the depth at which the ray meets it.
#if RAY
inline V log2_alpha(V dx, V dy, const float *s, V *depth) {
    V linear = s[SPLAT_LX] * dx + s[SPLAT_LY] * dy;
    V norm = (1.0f + 2.0f * linear) + (s[SPLAT_MXX] * dx * dx + dy * (2.0f * s[SPLAT_MXY] * dx + s[SPLAT_MYY] * dy));
    V inverse = 1.0f / norm;
    V across = s[SPLAT_A] * dx + s[SPLAT_B] * dy, down = s[SPLAT_C] * dy;
    V form = across * across + down * down;
    V exponent = s[SPLAT_LOG2_OPACITY] - form * inverse;
    *depth = s[SPLAT_DEPTH] * (1.0f + linear) * inverse;  // t*, where the Gaussian's maximum along the ray lies
    return *depth > (V)NEAR_PLANE ? exponent : (V)-1000.0f;
}
#else
inline V ewa_exponent(V across, V down, const float *s) {
    return (s[SPLAT_LOG2_OPACITY] - down * down) - across * across;
}

inline V log2_alpha(V dx, V dy, const float *s, V *depth) {
    *depth = (V)s[SPLAT_DEPTH];
    return ewa_exponent(s[SPLAT_A] * dx + s[SPLAT_B] * dy, s[SPLAT_C] * dy, s);
}
#endif

// Blend one splat: returns its weight alpha * T, and moves T on.
inline V blend(V exponent, V *transmittance) {
    V alpha = MIN(exp2_polynomial(exponent), (V)ALPHA_MAX);
    alpha = AS_FLOAT(AS_INT(alpha) & MASK(exponent >= (V)LOG2_ALPHA_MIN));
    V before = *transmittance;
    V weight = alpha * MAX(before, (V)0.0f);
    V after = before - weight;
    I stop = MASK(after < (V)TRANSMITTANCE_MIN);
    *transmittance = stop ? AS_FLOAT(AS_INT(before) | SIGN_BIT) : after;
    return stop ? (V)0.0f : weight;
}
