// Statistics of densification: per Gaussian, the number of views that show it, and the sum over these views of the norm of
// dL/d(projected centre), in units of the normalized image (3DGS's NDC).

// Adds a view with the gradient (x, y) of the projected centre, per pixel.
inline void count_view(float x, float y, float half_width, float half_height, uint position, __global float *norms,
                       __global uint *views) {
    x *= half_width;
    y *= half_height;
    norms[position] += sqrt(x * x + y * y);
    views[position]++;
}

__kernel void accumulate_statistics(uint count, float half_width, float half_height,
                                    __global const uint *depth_keys,         // [K]
                                    __global const float *centre_gradients,  // [blocks,2,BLOCK]
                                    __global float *norms,                   // [K]
                                    __global uint *views) {                  // [K]
    uint position = get_global_id(0);
    if (position >= count || depth_keys[position] == NOT_VISIBLE) return;
    float x = centre_gradients[ELEMENT(2, 0, position)], y = centre_gradients[ELEMENT(2, 1, position)];
    count_view(x, y, half_width, half_height, position, norms, views);
}
