// Gradient of spherical-harmonic colour with respect to the coefficients and to the direction.

#if SH_DEGREE >= 0
// d basis / d(x, y, z), contracted with `weights` [SH_BANDS] = dL/dbasis: direction[3] = dL/d(x, y, z).
inline void sh_direction_gradient(V x, V y, V z, const V *weights, V *direction) {
    V gx = (V)0.0f, gy = (V)0.0f, gz = (V)0.0f;
#if SH_DEGREE >= 1
    gx -= 0.48860251f * weights[3];
    gy -= 0.48860251f * weights[1];
    gz += 0.48860251f * weights[2];
#endif
#if SH_DEGREE >= 2
    gx += 1.09254843f * (y * weights[4] - z * weights[7] + x * weights[8]) - 0.63078313f * x * weights[6];
    gy += 1.09254843f * (x * weights[4] - z * weights[5] - y * weights[8]) - 0.63078313f * y * weights[6];
    gz += 1.26156626f * z * weights[6] - 1.09254843f * (y * weights[5] + x * weights[7]);
#endif
#if SH_DEGREE >= 3
    V xx = x * x, yy = y * y, zz = z * z, xy = x * y, yz = y * z, xz = x * z;
    gx += -3.54026154f * xy * weights[9] + 2.89061144f * yz * weights[10] + 0.91409160f * xy * weights[11] -
          2.23905798f * xz * weights[12] - 0.45704580f * (4.0f * zz - 3.0f * xx - yy) * weights[13] +
          2.89061144f * xz * weights[14] - 1.77013077f * (xx - yy) * weights[15];
    gy += -1.77013077f * (xx - yy) * weights[9] + 2.89061144f * xz * weights[10] -
          0.45704580f * (4.0f * zz - xx - 3.0f * yy) * weights[11] - 2.23905798f * yz * weights[12] +
          0.91409160f * xy * weights[13] - 2.89061144f * yz * weights[14] + 3.54026154f * xy * weights[15];
    gz += 2.89061144f * xy * weights[10] - 3.65636640f * yz * weights[11] +
          0.37317633f * (6.0f * zz - 3.0f * xx - 3.0f * yy) * weights[12] - 3.65636640f * xz * weights[13] +
          1.44530572f * (xx - yy) * weights[14];
#endif
    direction[0] = gx;
    direction[1] = gy;
    direction[2] = gz;
}
#endif
