// Adam (Kingma & Ba 2015, algorithm 1) over the parameters on the device.
//
//   m <- beta1 m + (1 - beta1) g,  v <- beta2 v + (1 - beta2) g^2
//   raw <- raw - rate m / (1 - beta1^t) / (sqrt(v / (1 - beta2^t)) + epsilon)
//
// A work-item handles LANES positions. Parameters are stored raw, as in the PLY (log scales, opacity logits). Gradients are
// with respect to the activated values, so the chain rule comes first, and the activated copy is updated too.

// One step; corrections = 1 / (1 - beta^t), gains = 1 - beta.
inline V adam_step(V gradient, float rate, float first_correction, float second_correction, V *first, V *second) {
    *first = ADAM_BETA1 * *first + ADAM_GAIN1 * gradient;
    *second = ADAM_BETA2 * *second + ADAM_GAIN2 * gradient * gradient;
    return rate * first_correction * *first / (sqrt(second_correction * *second) + ADAM_EPSILON);
}

// The activated value of raw attribute i: exp of scales, logistic function of the opacity.
inline V activated_value(int i, V raw) {
    if (i >= GEOMETRY_SCALES && i < GEOMETRY_OPACITY) return exp(raw);
    if (i == GEOMETRY_OPACITY) return 1.0f / (1.0f + exp(-raw));
    return raw;
}

__kernel void activate_geometry(uint count,
                                __global const float *raw,    // [blocks,GEOMETRY_ATTRIBUTES,BLOCK]
                                __global float *activated) {  // [blocks,GEOMETRY_ATTRIBUTES,BLOCK]
    uint position = get_global_id(0) * LANES;
    if (position >= count) return;
    for (int i = 0; i < GEOMETRY_ATTRIBUTES; i++)
        STORE_ATTRIBUTE(activated_value(i, LOAD_ATTRIBUTE(raw, GEOMETRY_ATTRIBUTES, i, position)), activated,
                        GEOMETRY_ATTRIBUTES, i);
}

__kernel void adam_geometry(uint count, float first_correction, float second_correction,
                            __constant const float *rates,    // [GEOMETRY_ATTRIBUTES]
                            __global const float *gradients,  // [blocks,GEOMETRY_ATTRIBUTES,BLOCK]
                            __global float *raw,              // [blocks,GEOMETRY_ATTRIBUTES,BLOCK]
                            __global float *first,            // [blocks,GEOMETRY_ATTRIBUTES,BLOCK]
                            __global float *second,           // [blocks,GEOMETRY_ATTRIBUTES,BLOCK]
                            __global float *activated) {      // [blocks,GEOMETRY_ATTRIBUTES,BLOCK]
    uint position = get_global_id(0) * LANES;
    if (position >= count) return;
#pragma unroll
    for (int i = 0; i < GEOMETRY_ATTRIBUTES; i++) {
        V active = LOAD_ATTRIBUTE(activated, GEOMETRY_ATTRIBUTES, i, position);
        V gradient = LOAD_ATTRIBUTE(gradients, GEOMETRY_ATTRIBUTES, i, position);
        if (i >= GEOMETRY_SCALES && i < GEOMETRY_OPACITY) gradient *= active;  // d exp(x) = exp(x) dx
        if (i == GEOMETRY_OPACITY) gradient *= active * (1.0f - active);       // d sigmoid(x)
        V m = LOAD_ATTRIBUTE(first, GEOMETRY_ATTRIBUTES, i, position);
        V v = LOAD_ATTRIBUTE(second, GEOMETRY_ATTRIBUTES, i, position);
        V value = LOAD_ATTRIBUTE(raw, GEOMETRY_ATTRIBUTES, i, position);
        value -= adam_step(gradient, rates[i], first_correction, second_correction, &m, &v);
        STORE_ATTRIBUTE(m, first, GEOMETRY_ATTRIBUTES, i);
        STORE_ATTRIBUTE(v, second, GEOMETRY_ATTRIBUTES, i);
        STORE_ATTRIBUTE(value, raw, GEOMETRY_ATTRIBUTES, i);
        STORE_ATTRIBUTE(activated_value(i, value), activated, GEOMETRY_ATTRIBUTES, i);
    }
}

__kernel void adam_channels(uint count, float dc_rate, float rest_rate, float first_correction,
                            float second_correction,
                            __global const float *gradients,  // [blocks,CHANNEL_ATTRIBUTES,BLOCK]
                            __global float *raw,              // [blocks,CHANNEL_ATTRIBUTES,BLOCK]
                            __global float *first,            // [blocks,CHANNEL_ATTRIBUTES,BLOCK]
                            __global float *second) {         // [blocks,CHANNEL_ATTRIBUTES,BLOCK]
    uint position = get_global_id(0) * LANES;
    if (position >= count) return;
    for (int i = 0; i < CHANNEL_ATTRIBUTES; i++) {
        V gradient = LOAD_ATTRIBUTE(gradients, CHANNEL_ATTRIBUTES, i, position);
        V m = LOAD_ATTRIBUTE(first, CHANNEL_ATTRIBUTES, i, position);
        V v = LOAD_ATTRIBUTE(second, CHANNEL_ATTRIBUTES, i, position);
        V value = LOAD_ATTRIBUTE(raw, CHANNEL_ATTRIBUTES, i, position);
        value -= adam_step(gradient, i < 3 ? dc_rate : rest_rate, first_correction, second_correction, &m, &v);
        STORE_ATTRIBUTE(m, first, CHANNEL_ATTRIBUTES, i);
        STORE_ATTRIBUTE(v, second, CHANNEL_ATTRIBUTES, i);
        STORE_ATTRIBUTE(value, raw, CHANNEL_ATTRIBUTES, i);
    }
}
