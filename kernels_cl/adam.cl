// Adam (Kingma & Ba 2015) over the parameters on the device, and what densification wants to know of each view.
//
// A work-item handles LANES positions. Parameters are kept raw, as the PLY stores them (log scales, opacity logits); the
// renderer's activated copy is written along. Gradients arrive with respect to the activated values.

// One step; corrections = 1 / (1 - beta^t), gains = 1 - beta.
inline V adam_step(V gradient, float rate, float first_correction, float second_correction, V *first, V *second) {
    *first = ADAM_BETA1 * *first + ADAM_GAIN1 * gradient;
    *second = ADAM_BETA2 * *second + ADAM_GAIN2 * gradient * gradient;
    return rate * first_correction * *first / (sqrt(second_correction * *second) + ADAM_EPSILON);
}

// What the renderer takes of raw attribute i: scales by exp, opacity by the logistic function.
inline V activated_value(int i, V raw) {
    if (i >= 7 && i < 10) return exp(raw);
    if (i == 10) return 1.0f / (1.0f + exp(-raw));
    return raw;
}

__kernel void activate_geometry(uint count, __global const float *raw, __global float *activated) {
    uint position = get_global_id(0) * LANES;
    if (position >= count) return;
    for (int i = 0; i < GEOMETRY; i++)
        STORE_ATTRIBUTE(activated_value(i, LOAD_ATTRIBUTE(raw, GEOMETRY, i, position)), activated, GEOMETRY, i);
}

__kernel void adam_geometry(uint count, __constant const float *rates, float first_correction, float second_correction,
                            __global const float *gradients, __global float *raw, __global float *first,
                            __global float *second, __global float *activated) {
    uint position = get_global_id(0) * LANES;
    if (position >= count) return;
#pragma unroll
    for (int i = 0; i < GEOMETRY; i++) {
        V active = LOAD_ATTRIBUTE(activated, GEOMETRY, i, position), gradient = LOAD_ATTRIBUTE(gradients, GEOMETRY, i, position);
        if (i >= 7 && i < 10) gradient *= active;                 // d exp(x) = exp(x) dx
        if (i == 10) gradient *= active * (1.0f - active);        // d sigmoid(x)
        V m = LOAD_ATTRIBUTE(first, GEOMETRY, i, position), v = LOAD_ATTRIBUTE(second, GEOMETRY, i, position);
        V value = LOAD_ATTRIBUTE(raw, GEOMETRY, i, position);
        value -= adam_step(gradient, rates[i], first_correction, second_correction, &m, &v);
        STORE_ATTRIBUTE(m, first, GEOMETRY, i);
        STORE_ATTRIBUTE(v, second, GEOMETRY, i);
        STORE_ATTRIBUTE(value, raw, GEOMETRY, i);
        STORE_ATTRIBUTE(activated_value(i, value), activated, GEOMETRY, i);
    }
}

__kernel void adam_channels(uint count, float dc_rate, float rest_rate, float first_correction,
                            float second_correction, __global const float *gradients, __global float *raw,
                            __global float *first, __global float *second) {
    uint position = get_global_id(0) * LANES;
    if (position >= count) return;
    for (int i = 0; i < CHANNEL_ATTRIBUTES; i++) {
        V gradient = LOAD_ATTRIBUTE(gradients, CHANNEL_ATTRIBUTES, i, position);
        V m = LOAD_ATTRIBUTE(first, CHANNEL_ATTRIBUTES, i, position), v = LOAD_ATTRIBUTE(second, CHANNEL_ATTRIBUTES, i, position);
        V value = LOAD_ATTRIBUTE(raw, CHANNEL_ATTRIBUTES, i, position);
        value -= adam_step(gradient, i < 3 ? dc_rate : rest_rate, first_correction, second_correction, &m, &v);
        STORE_ATTRIBUTE(m, first, CHANNEL_ATTRIBUTES, i);
        STORE_ATTRIBUTE(v, second, CHANNEL_ATTRIBUTES, i);
        STORE_ATTRIBUTE(value, raw, CHANNEL_ATTRIBUTES, i);
    }
}

// Norm of dL/d(projected centre) in units of the normalized image (3DGS's NDC), summed over the views that show it.
__kernel void accumulate_statistics(uint count, float half_width, float half_height, __global const uint *depth_keys,
                                    __global const float *centre_gradients, __global float *norms, __global uint *views) {
    uint position = get_global_id(0);
    if (position >= count || depth_keys[position] == NOT_VISIBLE) return;
    __global const float *g = centre_gradients + position / 16 * 32 + position % 16;
    float x = half_width * g[0], y = half_height * g[16];
    norms[position] += sqrt(x * x + y * y);
    views[position]++;
}
