// Gradient of the blended image, gpu style: a work-group per tile, a pixel per work-item; the arithmetic of
// blending_backward_cpu.cl. Per entry, the group's values meet in local memory, TOGETHER at a time: a work-item adds those of
// 16 pixels, another one these 16 sums. The order is fixed, so the result does not depend on scheduling.

#define PIXELS (TILE * TILE)
#define TOGETHER 12
#define PARTS 16
#define STRIDE (PIXELS + PARTS)  // values of one pixel lie in different banks of local memory
#define LOOK 32                  // entries between looks at whether a pixel is still unfinished

__kernel __attribute__((reqd_work_group_size(TILE * TILE, 1, 1)))
void blend_tiles_backward(int width, int height, int tiles_x, int first_tile,
                          __global const float *splats,          // [K,SPLAT]
                          __global const uint2 *entries,         // [E], (position, slot)
                          __global const uint *tile_starts,      // [tiles+1]
                          __global const float *image,           // [H,W,CHANNELS]
                          __global const float *image_gradient,  // [H,W,CHANNELS]
                          __global float *slot_gradients) {      // [E,SLOT_GRADIENT]
    __local float staged[TOGETHER * STRIDE], sums[TOGETHER * PARTS];
    __local uint unfinished;
    int item = get_local_id(0), tile = get_group_id(0);
    int x = (first_tile + tile) % tiles_x * TILE + item % TILE, y = (first_tile + tile) / tiles_x * TILE + item / TILE;
    bool inside = x < width && y < height;

    float T = inside ? 1.0f : -1.0f, F = 0.0f, g[CHANNELS];
    size_t pixel = inside ? ((size_t)y * width + x) * CHANNELS : 0;
    for (int c = 0; c < CHANNELS; c++) {
        g[c] = inside ? image_gradient[pixel + c] : 0.0f;
        F += inside ? image[pixel + c] * g[c] : 0.0f;
    }

    uint begin = tile_starts[tile], end = tile_starts[tile + 1];
    for (uint entry = begin; entry < end; entry++) {
        if ((entry - begin) % LOOK == 0) {
            if (item == 0) unfinished = 0;
            barrier(CLK_LOCAL_MEM_FENCE);
            if (T > 0.0f) atomic_inc(&unfinished);
            barrier(CLK_LOCAL_MEM_FENCE);
            if (unfinished == 0) {  // the same for the whole group
                for (uint rest = entry + item; rest < end; rest += PIXELS)
                    for (int i = 0; i < SLOT_GRADIENT; i++)
                        slot_gradients[(size_t)SLOT_GRADIENT * entries[rest].y + i] = 0.0f;
                return;
            }
        }
        float s[SPLAT_CHANNELS + CHANNELS], values[SLOT_GRADIENT];
        for (int i = 0; i < SPLAT_CHANNELS + CHANNELS; i++) s[i] = splats[(size_t)SPLAT * entries[entry].x + i];
        float dx = x + 0.5f - s[SPLAT_U], dy = y + 0.5f - s[SPLAT_V];
        float a = s[SPLAT_A] * dx + s[SPLAT_B] * dy, b = s[SPLAT_C] * dy;
        float exponent = (s[SPLAT_LOG2_OPACITY] - b * b) - a * a, along = 0.0f;
        float weight = blend(exponent, INFINITY, &T);
        for (int c = 0; c < CHANNELS; c++) {
            along += g[c] * s[SPLAT_CHANNELS + c];
            values[MOMENTS + c] = weight * g[c];
        }
        F -= weight * along;
        float alpha = exp2_polynomial(exponent);
        bool flows = weight > 0.0f && alpha < ALPHA_MAX;
        float dp = flows ? LN2 * (weight * along - F * (alpha / (1.0f - alpha))) : 0.0f;
        values[0] = dp;
        values[1] = dp * a;
        values[2] = dp * b;
        values[3] = dp * a * a;
        values[4] = dp * a * b;
        values[5] = dp * b * b;
        for (int first = 0; first < SLOT_GRADIENT; first += TOGETHER) {
            int count = min(TOGETHER, SLOT_GRADIENT - first);
            for (int i = 0; i < count; i++) staged[i * STRIDE + item] = values[first + i];
            barrier(CLK_LOCAL_MEM_FENCE);
            if (item < count * PARTS) {
                float sum = 0.0f;
                for (int i = 0; i < PIXELS / PARTS; i++) sum += staged[item / PARTS * STRIDE + i * PARTS + item % PARTS];
                sums[item] = sum;
            }
            barrier(CLK_LOCAL_MEM_FENCE);
            if (item < count) {
                float sum = 0.0f;
                for (int i = 0; i < PARTS; i++) sum += sums[item * PARTS + i];
                slot_gradients[(size_t)SLOT_GRADIENT * entries[entry].y + first + item] = sum;
            }
        }
    }
}
