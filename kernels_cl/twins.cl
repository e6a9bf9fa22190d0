// Twins: two models with one geometry, trained together.
//
// A work-item handles LANES positions. Both models' gradients g and h of means, quaternions and scales are replaced by
// g + w h, so that equal steps keep the geometry equal. Opacities stay separate. For the statistics, two models rendered from
// one pose are one view: it counts for Gaussians that either model shows, with g + w h of the projected centre. From two
// poses they are two views.
__kernel void share_gradients(uint count, float weight, uint one_pose,
                              float half_width, float half_height, float second_half_width, float second_half_height,
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
        uint x = ELEMENT(2, 0, p), y = ELEMENT(2, 1, p);
        bool visible = keys[p] != NOT_VISIBLE, second_visible = second_keys[p] != NOT_VISIBLE;
        float gx = weight * second_centres[x], gy = weight * second_centres[y];
        if (one_pose) {
            if (visible || second_visible)
                count_view(centres[x] + gx, centres[y] + gy, half_width, half_height, p, norms, views);
        } else {
            if (visible) count_view(centres[x], centres[y], half_width, half_height, p, norms, views);
            if (second_visible) count_view(gx, gy, second_half_width, second_half_height, p, norms, views);
        }
    }
}
