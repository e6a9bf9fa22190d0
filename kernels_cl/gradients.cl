// Splat gradients: the slot gradients of each Gaussian in a band, added to its sums of earlier bands.
//
// A work-item handles one rank, in the order of contributions.cl; the first band only writes, too. Sums are stored in blocks
// (vector.cl), as projection_backward.cl reads them; those of invisible Gaussians are not.

__kernel void sum_slot_gradients(uint visible,
                                 __global const uint *order,            // [V]
                                 __global const uint2 *slot_ranges,     // [V]
                                 __global const float *slot_gradients,  // [E,SLOT_GRADIENT]
                                 __global float *splat_gradients) {     // [blocks,SLOT_GRADIENT,BLOCK]
    uint rank = get_global_id(0);
    if (rank >= visible) return;
    uint position = order[rank];
    float sums[SLOT_GRADIENT];
    __global float *out = splat_gradients + (size_t)(position / BLOCK * SLOT_GRADIENT) * BLOCK + position % BLOCK;
    for (int i = 0; i < SLOT_GRADIENT; i++) sums[i] = FIRST_BAND ? 0.0f : out[BLOCK * i];
    for (uint slot = slot_ranges[rank].x; slot < slot_ranges[rank].y; slot++)
        for (int i = 0; i < SLOT_GRADIENT; i++) sums[i] += slot_gradients[(size_t)SLOT_GRADIENT * slot + i];
    for (int i = 0; i < SLOT_GRADIENT; i++) out[BLOCK * i] = sums[i];
}
