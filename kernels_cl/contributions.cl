// Sums over a Gaussian's slots: what it gave to all tiles of a band, added to what it gave to earlier bands.
//
// Slots of one Gaussian are contiguous and in tile order, so the sum runs left to right over the whole image, with the
// same rounding for any number of bands and threads.

// A record is that of gspure.renderer.CONTRIBUTION: index, sum, max, pixels. Records that nothing was added to stay zero.
__kernel void sum_slots(uint visible, __global const uint *order, __global const uint *rows, __global const uint2 *slot_ranges,
                        __global const float *partials, __global uint *records) {
    uint rank = get_global_id(0);
    if (rank >= visible) return;
    uint row = rows[order[rank]];
    uint4 record = vload4(row, records);
    float sum = as_float(record.y), maximum = as_float(record.z);
    uint touched = record.w;
    for (uint slot = slot_ranges[rank].x; slot < slot_ranges[rank].y; slot++) {
        __global const float *partial = partials + (size_t)3 * slot;
        sum += partial[0];
        maximum = max(maximum, partial[1]);
        touched += as_uint(partial[2]);
    }
    vstore4((uint4)(row, as_uint(sum), as_uint(maximum), touched), row, records);
}
