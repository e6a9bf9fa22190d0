// One source for two kernel styles: V is float16 in the `cpu` style, where a work-item handles 16 Gaussians or a row of
// 16 pixels with no barriers, and float in the `gpu` style, where a work-item handles one.
//
// Plain `a * b + c` is written on purpose: compilers contract it to an FMA, while mad() is two instructions on PoCL.
// `a < b ? a : b` is one vector minimum; fmin() adds NaN handling.

#if LANES == 16
typedef float16 V;
typedef int16 I;
typedef uint16 U;
#define TO_INT(x) convert_int16(x)
#define TO_UINT(x) convert_uint16(x)
#define AS_INT(x) as_int16(x)
#define AS_UINT(x) as_uint16(x)
#define AS_FLOAT(x) as_float16(x)
#define ANY(mask) any(mask)
// Masks are -1 / 0 per lane, as vector comparisons give them.
#define MASK(condition) (condition)
#else
typedef float V;
typedef int I;
typedef uint U;
#define TO_INT(x) convert_int(x)
#define TO_UINT(x) convert_uint(x)
#define AS_INT(x) as_int(x)
#define AS_UINT(x) as_uint(x)
#define AS_FLOAT(x) as_float(x)
#define ANY(mask) ((mask) != 0)
#define MASK(condition) (-(I)(condition))
#endif

#define MIN(a, b) ((a) < (b) ? (a) : (b))
#define MAX(a, b) ((a) > (b) ? (a) : (b))
#define SIGN_BIT ((I)0x80000000)
#define LN2 0.69314718f

#if LANES == 16
inline float sum16(float16 v) {
    float8 a = v.lo + v.hi;
    float4 b = a.lo + a.hi;
    float2 c = b.lo + b.hi;
    return c.x + c.y;
}
#endif

// Attributes of Gaussians are stored in blocks of 16 positions, [blocks][attributes][BLOCK]: a vector load in the cpu style,
// a coalesced one in the gpu style, and one memory stream for all attributes.
#define ELEMENT(attributes, attribute, position) \
    (((position) / BLOCK * (attributes) + (attribute)) * BLOCK + (position) % BLOCK)
#if LANES == 16
#define LOAD_ATTRIBUTE(array, attributes, attribute, position) \
    vload16((position) / BLOCK * (attributes) + (attribute), array)
#define STORE_ATTRIBUTE(value, array, attributes, attribute) \
    vstore16(value, position / BLOCK * (attributes) + (attribute), array)
#else
#define LOAD_ATTRIBUTE(array, attributes, attribute, position) (array)[ELEMENT(attributes, attribute, position)]
#define STORE_ATTRIBUTE(value, array, attributes, attribute) (array)[ELEMENT(attributes, attribute, position)] = (value)
#endif

// The first attribute of each part of the geometry: means 0, then
#define GEOMETRY_QUATS 3
#define GEOMETRY_SCALES 7
#define GEOMETRY_OPACITY 10

// 2^x for x in [-126, 127], relative error below 4e-7: the degree-5 polynomial on [-1/2, 1/2] with the least relative
// error (7e-8) among those that are 1 at 0, and its rounding. Adding 1.5 * 2^23 leaves the nearest integer in the low
// mantissa bits, hence never build with -cl-fast-relaxed-math, which would cancel it.
// Below -126 the result is garbage: callers mask by the exponent.
inline V exp2_polynomial(V x) {
    const V magic = (V)12582912.0f;
    V shifted = x + magic;
    V f = x - (shifted - magic);
    V p = (V)1.3202983e-3f;
    p = p * f + (V)9.6749520e-3f;
    p = p * f + (V)5.5510474e-2f;
    p = p * f + (V)2.4022166e-1f;
    p = p * f + (V)6.9314660e-1f;
    p = p * f + (V)1.0f;
    return AS_FLOAT(AS_INT(p) + (AS_INT(shifted) << 23));
}
