// Colour from real spherical harmonics, in 3DGS's order and signs (degree 0 to 3).

#if SH_DEGREE >= 0
#define SH_BANDS ((SH_DEGREE + 1) * (SH_DEGREE + 1))

// basis[SH_BANDS] for unit directions (x, y, z) from the camera to the Gaussians.
inline void sh_basis(V x, V y, V z, V *basis) {
    basis[0] = (V)0.28209479f;
#if SH_DEGREE >= 1
    basis[1] = -0.48860251f * y;
    basis[2] = 0.48860251f * z;
    basis[3] = -0.48860251f * x;
#endif
#if SH_DEGREE >= 2
    V xx = x * x, yy = y * y, zz = z * z;
    basis[4] = 1.09254843f * x * y;
    basis[5] = -1.09254843f * y * z;
    basis[6] = 0.31539157f * (2.0f * zz - xx - yy);
    basis[7] = -1.09254843f * x * z;
    basis[8] = 0.54627422f * (xx - yy);
#endif
#if SH_DEGREE >= 3
    basis[9] = -0.59004359f * y * (3.0f * xx - yy);
    basis[10] = 2.89061144f * x * y * z;
    basis[11] = -0.45704580f * y * (4.0f * zz - xx - yy);
    basis[12] = 0.37317633f * z * (2.0f * zz - 3.0f * xx - 3.0f * yy);
    basis[13] = -0.45704580f * x * (4.0f * zz - xx - yy);
    basis[14] = 1.44530572f * z * (xx - yy);
    basis[15] = -0.59004359f * x * (xx - 3.0f * yy);
#endif
}

// colour[3] = max(0, 0.5 + sum_b basis_b c_b), bounded, of 16 Gaussians (or one) from `position` on.
inline void sh_colour(__global const float *sh_coeffs, uint position, V x, V y, V z, V *colour) {
    V basis[SH_BANDS];
    sh_basis(x, y, z, basis);
    V rgb[3] = {(V)0.5f, (V)0.5f, (V)0.5f};
#pragma unroll
    for (int b = 0; b < SH_BANDS; b++)
#pragma unroll
        for (int c = 0; c < 3; c++) rgb[c] += basis[b] * LOAD_ATTRIBUTE(sh_coeffs, CHANNEL_ATTRIBUTES, 3 * b + c, position);
#pragma unroll
    for (int c = 0; c < 3; c++) colour[c] = MIN(MAX(rgb[c], (V)0.0f), (V)COLOUR_MAX);
}
#endif
