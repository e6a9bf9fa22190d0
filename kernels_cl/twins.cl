// Two models with one geometry: what each has learned of it becomes what both have learned.
//
// A work-item handles LANES positions. Means, quaternions and scales (attributes 0 to 9) get g = a + w b, in both models'
// gradients, so that equal steps keep them equal; opacities stay each model's own. The projected centre's gradient is of
// the same sum, and goes to the statistics of densification as in adam.cl; a Gaussian is seen if either model shows it.
__kernel void share_gradients(uint count, float weight, float half_width, float half_height,
                              __global const uint *keys, __global const uint *other_keys,
                              __global float *geometry, __global float *other_geometry,
                              __global const float *centres, __global const float *other_centres,
                              __global float *norms, __global uint *views) {
    uint position = get_global_id(0) * LANES;
    if (position >= count) return;
    for (int i = 0; i < GEOMETRY - 1; i++) {
        V both = LOAD_ATTRIBUTE(geometry, GEOMETRY, i, position) + weight * LOAD_ATTRIBUTE(other_geometry, GEOMETRY, i, position);
        STORE_ATTRIBUTE(both, geometry, GEOMETRY, i);
        STORE_ATTRIBUTE(both, other_geometry, GEOMETRY, i);
    }
    for (uint p = position; p < min(position + LANES, count); p++) {
        if (keys[p] == NOT_VISIBLE && other_keys[p] == NOT_VISIBLE) continue;
        uint at = p / 16 * 32 + p % 16;
        float x = half_width * (centres[at] + weight * other_centres[at]);
        float y = half_height * (centres[at + 16] + weight * other_centres[at + 16]);
        norms[p] += sqrt(x * x + y * y);
        views[p]++;
    }
}
