// Contributions: the slots of each Gaussian in a band, added to its record of earlier bands.
//
// A work-item handles one rank. Slots of a Gaussian are contiguous and in tile order, so the sum has one order over the
// whole image, and the same rounding for any number of bands and threads. A record is (index, sum, max, pixels). The first
// band only writes records: reading them too would take twice the time, since ranks lie scattered over the rows.
__kernel void sum_slots(uint visible,
                        __global const uint *order,         // [V]
                        __global const uint *rows,          // [K]
                        __global const uint2 *slot_ranges,  // [V]
                        __global const float *partials,     // [E,3]
                        __global uint *records) {           // [K,4]: gspure.renderer.CONTRIBUTION
    uint rank = get_global_id(0);
    if (rank >= visible) return;
    uint row = rows[order[rank]];
#if FIRST_BAND
    uint4 record = (uint4)(0);
#else
    uint4 record = vload4(row, records);
#endif
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
