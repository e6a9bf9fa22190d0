// Twins: two models with one geometry, trained together.
//
// A work-item handles LANES positions. Both models' gradients g and h of means, quaternions and scales are replaced by
// g + w h, so that equal steps keep the geometry equal. Opacities stay separate. The statistics count g + w h of the
// projected centre, for Gaussians that either model shows.
__kernel void share_gradients(uint count, float weight, float half_width, float half_height,
                              __global const uint *keys,             // [K]: depth keys in the first model
                              __global const uint *second_keys,      // [K]
                              __global float *geometry,              // [blocks,GEOMETRY_ATTRIBUTES,BLOCK]
                              __global float *second_geometry,       // [blocks,GEOMETRY_ATTRIBUTES,BLOCK]
                              __global const float *centres,         // [blocks,2,BLOCK]
                              __global const float *second_centres,  // [blocks,2,BLOCK]
                              __global float *norms,                 // [K]
                              __global uint *views) {                // [K]
    uint position = get_global_id(0) * LANES;
    if (position >= count) return;
    for (int i = 0; i < GEOMETRY_OPACITY; i++) {
        V both = LOAD_ATTRIBUTE(geometry, GEOMETRY_ATTRIBUTES, i, position) +
                 weight * LOAD_ATTRIBUTE(second_geometry, GEOMETRY_ATTRIBUTES, i, position);
        STORE_ATTRIBUTE(both, geometry, GEOMETRY_ATTRIBUTES, i);
        STORE_ATTRIBUTE(both, second_geometry, GEOMETRY_ATTRIBUTES, i);
    }
    for (uint p = position; p < min(position + LANES, count); p++) {
        if (keys[p] == NOT_VISIBLE && second_keys[p] == NOT_VISIBLE) continue;
        uint x = ELEMENT(2, 0, p), y = ELEMENT(2, 1, p);
        count_view(centres[x] + weight * second_centres[x], centres[y] + weight * second_centres[y], half_width,
                   half_height, p, norms, views);
    }
}
