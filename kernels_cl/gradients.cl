// Sums of a Gaussian's slot gradients over all tiles of a band, added to those of earlier bands, in blocks of 16
// positions ([positions / 16][MOMENTS + CHANNELS][16]) as projection_backward.cl reads them.

__kernel void sum_slot_gradients(uint visible, __global const uint *order, __global const uint2 *slot_ranges,
                                 __global const float *slot_gradients, __global float *splat_gradients) {
    uint rank = get_global_id(0);
    if (rank >= visible) return;
    uint position = order[rank];
    float sums[SLOT_GRADIENT];
    __global float *out = splat_gradients + (size_t)(position / BLOCK * SLOT_GRADIENT) * BLOCK + position % BLOCK;
    for (int i = 0; i < SLOT_GRADIENT; i++) sums[i] = out[BLOCK * i];
    for (uint slot = slot_ranges[rank].x; slot < slot_ranges[rank].y; slot++)
        for (int i = 0; i < SLOT_GRADIENT; i++) sums[i] += slot_gradients[(size_t)SLOT_GRADIENT * slot + i];
    for (int i = 0; i < SLOT_GRADIENT; i++) out[BLOCK * i] = sums[i];
}
