// Binning: depth-ordered Gaussians -> one depth-ordered list per tile, for a band of tile rows.
//
// The visible Gaussians are already in depth order; a stable sort by tile keeps that order in every list. In the cpu
// style, it is a counting sort: the depth order is cut into `chunks` contiguous parts, one work-item each:
//   bound_entries      the most entries of each chunk: the area of its tile rectangles
//   bound_band         the same for a band of tile rows, if one band does not fit
//   (host)             prefix sums: the first entry of each chunk
//   emit_entries       walk the tiles of each Gaussian: its position and tile per entry, and the histogram of tiles
//   scan_chunks        (counting.cl), then scan_totals over the tiles
//   scatter_entries    move the entries to their tiles' lists
// In the gpu style, it is a radix sort of pairs:
//   bound_entries      as above, by groups of Gaussians
//   count_entries      the entries of each Gaussian, then their running sums (sorting.cl)
//   emit_pairs         tile and slot of each entry, then sorted by tile (sorting.cl)
//   find_tile_starts, place_entries  (pairs.cl)
// The place of an entry in emission order is its *slot*: slots of a Gaussian are contiguous, in tile order. Slots and
// places do not depend on the number of threads.

typedef struct {
    float x, y, slope, y_extreme, inverse_syy, width2;
    int first, last, top, bottom;  // tile rectangle, inclusive
    bool unbounded;                // no ellipse
} Footprint;

// Comparisons, since PoCL's clamp, floor and ceil take several times as long.
#define CLAMP(v, low, high) ((v) < (low) ? (low) : (v) > (high) ? (high) : (v))

inline Footprint load_footprint(float8 f, int band_first, int band_last) {
    uint columns = as_uint(f.s5), rows = as_uint(f.s6);
    Footprint p;
    p.x = f.s0 - 0.5f;
    p.y = f.s1;
    p.slope = f.s2;
    p.y_extreme = f.s3;
    p.inverse_syy = f.s4;
    p.width2 = f.s7;
    p.first = columns & 0xffff;
    p.last = columns >> 16;
    p.top = max((int)(rows & 0xffff), band_first);
    p.bottom = min((int)(rows >> 16), band_last);
    p.unbounded = p.inverse_syy == 0.0f;
    return p;
}

// Several tile rows at a time in the cpu style.
#if LANES == 16
#define SPAN_ROWS 8
typedef float8 R;
typedef int8 N;
#define STEPS ((int8)(0, 1, 2, 3, 4, 5, 6, 7))
#define TO_ROWS(x) convert_float8(x)
#define TO_COLUMNS(x) convert_int8(x)
#else
#define SPAN_ROWS 1
typedef float R;
typedef int N;
#define STEPS 0
#define TO_ROWS(x) convert_float(x)
#define TO_COLUMNS(x) convert_int(x)
#endif

inline R half_width(const Footprint *p, R y) {
    R square = p->width2 * (1.0f - y * y * p->inverse_syy);
    return sqrt(square > (R)0.0f ? square : (R)0.0f);
}

// Tile columns [begin, end) of the tile rows from `ty` on (of the rectangle's) that hold a pixel centre of the ellipse.
// Inlined by force: PoCL would call it, with the footprint in memory, at an eighth of the time of binning.
__attribute__((always_inline)) inline void row_spans(const Footprint *p, int ty, N *begin, N *end) {
    // The band of pixel centres, relative to the centre; x over it is extreme at the ellipse's own extreme points, or at
    // the band's edges.
    R low = TO_ROWS(STEPS + ty) * TILE + (0.5f - FOOTPRINT_MARGIN) - p->y, high = low + (TILE - 1 + 2.0f * FOOTPRINT_MARGIN);
    R y_left = CLAMP((R)-p->y_extreme, low, high), y_right = CLAMP((R)p->y_extreme, low, high);
    R left = p->x + (p->slope * y_left - half_width(p, y_left)) - FOOTPRINT_MARGIN;
    R right = p->x + (p->slope * y_right + half_width(p, y_right)) + FOOTPRINT_MARGIN;
    R limit = (R)((p->last + 1) * TILE);  // keeps the conversions to int defined
    left = CLAMP(left, (R)0.0f, limit);
    N first = TO_COLUMNS(left), last = TO_COLUMNS(CLAMP(right, (R)0.0f, limit));
    first += TO_ROWS(first) < left ? (N)1 : (N)0;  // rounds up
    first = max(first / TILE, (N)p->first), last = min(last / TILE, (N)p->last) + 1;
    last = right < (R)0.0f ? first : last;
    N whole = (N)(p->unbounded || p->first == p->last ? -1 : 0);
    *begin = whole ? (N)p->first : first;
    *end = whole ? (N)(p->last + 1) : last;
}

#if RAY
// Whether a Gaussian that reaches behind the camera, or nearly, can touch a pixel of the tiles `first` to `last` of a row;
// of several tiles, only a bound is tested. Its alpha >= ALPHA_MIN exactly where level L^2 >= (G - level) K (layout.cl) and
// L > 0: a convex region that holds the projected centre. So it meets a tile if it holds a point of the tile's boundary, or
// if the tile holds the centre. Along an edge, L and the roots of K's squares are linear.
inline bool holds(float level, float excess, float along, float across, float down) {
    return along >= 0.0f && level * along * along >= 0.998f * excess * (across * across + down * down);
}

// Least square of a linear function on a rectangle whose corners have values from `low` to `high`.
inline float least_square(float low, float high) { return low > 0.0f ? low * low : high < 0.0f ? high * high : 0.0f; }

inline bool touches(__global const float *s, int first, int last, int ty) {
    const float margin = FOOTPRINT_MARGIN - 0.5f, half_height = 0.5f * TILE + margin;
    float half_width = 0.5f * TILE * (last - first + 1) + margin;
    float x = first * TILE - margin + half_width - s[SPLAT_U], y = ty * TILE - margin + half_height - s[SPLAT_V];
    float level = s[SPLAT_LOG2_OPACITY] - LOG2_ALPHA_MIN, excess = s[SPLAT_G] - level;
    // Values at the rectangle's centre, and their change over half a side.
    float lx = half_width * s[SPLAT_LX], ly = half_height * s[SPLAT_LY];
    float along = s[SPLAT_L0] + s[SPLAT_LX] * x + s[SPLAT_LY] * y;
    float ax = half_width * s[SPLAT_A], ay = half_height * s[SPLAT_B];
    float across = s[SPLAT_A0] + s[SPLAT_A] * x + s[SPLAT_B] * y;
    float dy = half_height * s[SPLAT_C], down = s[SPLAT_C0] + s[SPLAT_C] * y;

    // No ray before the camera, or none near enough even if L were largest where K is least.
    float most = along + fabs(lx) + fabs(ly), spread = fabs(ax) + fabs(ay);
    float rounding = 1e-6f * (fabs(s[SPLAT_L0]) + fabs(s[SPLAT_LX] * x) + fabs(s[SPLAT_LY] * y) + fabs(lx));
    most += rounding;
    float least = least_square(across - spread, across + spread) + least_square(down - dy, down + dy);
    if (!holds(level, excess, most, sqrt(least), 0.0f)) return false;
    if (first < last) return true;
    if (s[SPLAT_A0] == 0.0f && s[SPLAT_C0] == 0.0f && fabs(x) <= half_width && fabs(y) <= half_height) return true;
    along += rounding;
    for (int sign = -1; sign <= 1; sign += 2) {  // the edges to the left and right, above and below, from t = -1 to 1
        float l[2] = {along + sign * lx, along + sign * ly}, l_step[2] = {ly, lx};
        float a[2] = {across + sign * ax, across + sign * ay}, a_step[2] = {ay, ax};
        float d[2] = {down, down + sign * dy}, d_step[2] = {dy, 0.0f};
        for (int i = 0; i < 2; i++) {
            float curvature = level * l_step[i] * l_step[i] - excess * (a_step[i] * a_step[i] + d_step[i] * d_step[i]);
            float slope = level * l[i] * l_step[i] - excess * (a[i] * a_step[i] + d[i] * d_step[i]);
            float t = curvature < 0.0f ? CLAMP(-slope / curvature, -1.0f, 1.0f) : -1.0f;
            if (holds(level, excess, l[i] + t * l_step[i], a[i] + t * a_step[i], d[i] + t * d_step[i])) return true;
            if (holds(level, excess, l[i] + l_step[i], a[i] + a_step[i], d[i] + d_step[i])) return true;
        }
    }
    return false;
}

// The tiles [begin, end) of a row that such a Gaussian touches: one run, since the region is convex.
inline int2 touched_span(__global const float *s, int2 span, int ty) {
    if (!touches(s, span.x, span.y - 1, ty)) return (int2)(0, 0);
    while (span.x < span.y && !touches(s, span.x, span.x, ty)) span.x++;
    while (span.x < span.y && !touches(s, span.y - 1, span.y - 1, ty)) span.y--;
    return span;
}
#endif

#if LANES == 16
#define STAGED 32  // footprints
#define EMITTED_AT_A_TIME 8

#define CHUNK_OF_VISIBLE                                        \
    uint chunk = get_global_id(0);                              \
    if (chunk >= chunks) return;                                \
    uint chunk_size = (visible + chunks - 1) / chunks;          \
    uint begin = min(chunk * chunk_size, visible), end = min(begin + chunk_size, visible);

__kernel void bound_entries(uint visible, uint chunks,
                            __global const uint *order,  // [V]
                            __global const uint *areas,  // [K]
                            __global uint *bounds) {     // [chunks]
    CHUNK_OF_VISIBLE
    uint area = EMITTED_AT_A_TIME;
    for (uint rank = begin; rank < end; rank++) area += areas[order[rank]];
    bounds[chunk] = area;
}

__kernel void bound_band(uint visible, uint chunks, int band_first, int band_last,
                         __global const uint *order,        // [V]
                         __global const float *footprints,  // [K,FOOTPRINT_FLOATS]
                         __global uint *bounds) {           // [chunks]
    CHUNK_OF_VISIBLE
    uint area = EMITTED_AT_A_TIME;
    for (uint rank = begin; rank < end; rank++) {
        Footprint f = load_footprint(vload8(order[rank], footprints), band_first, band_last);
        area += (f.last - f.first + 1) * max(f.bottom - f.top + 1, 0);
    }
    bounds[chunk] = area;
}

// Writes (tile, position) of `count` tiles from `tile` on, and up to EMITTED_AT_A_TIME more behind them: without a branch for
// few tiles, which would often be mispredicted.
inline void emit(uint tile, uint position, int count, __global ulong *out) {
    ulong first = (ulong)position << 32 | tile;
    int i = 0;
    do {
        vstore8(first + i + (ulong8)(0, 1, 2, 3, 4, 5, 6, 7), 0, out + i);
        i += EMITTED_AT_A_TIME;
    } while (i < count);
}

__kernel void emit_entries(uint visible, uint chunks, int tiles_x, int band_first, int band_last,
                           __global const uint *order,         // [V]
                           __global const float *splats,       // [K,SPLAT]
                           __global const float *footprints,   // [K,FOOTPRINT_FLOATS]
                           __global const uint *chunk_starts,  // [chunks+1]
                           __global uint *chunk_ends,          // [chunks]
                           __global ulong *emitted,            // [E], tile | position << 32
                           __global uint2 *slot_ranges,        // [V]
                           __global uint *histogram) {         // [chunks,tiles]
    CHUNK_OF_VISIBLE
    uint slot = chunk_starts[chunk];
    float staged[STAGED * FOOTPRINT_FLOATS];
    for (uint rank = begin; rank < end; rank++) {
        uint place = (rank - begin) % STAGED;
        if (place == 0)  // nothing but loads, so that many cache misses are under way at a time
            for (uint i = 0; i < min((uint)STAGED, end - rank); i++) vstore8(vload8(order[rank + i], footprints), i, staged);
        Footprint footprint = load_footprint(vload8(place, staged), band_first, band_last);
        uint position = order[rank], first_slot = slot;
        for (int ty = footprint.top; ty <= footprint.bottom; ty += SPAN_ROWS) {
            union {
                N v;
                int i[SPAN_ROWS];
            } first, last;
            row_spans(&footprint, ty, &first.v, &last.v);
            for (int r = 0; r < SPAN_ROWS && ty + r <= footprint.bottom; r++) {
                int2 span = (int2)(first.i[r], last.i[r]);
#if RAY
                if (footprint.unbounded) span = touched_span(splats + (size_t)SPLAT * position, span, ty + r);
#endif
                emit((ty + r - band_first) * tiles_x + span.x, position, span.y - span.x, emitted + slot);
                slot += max(span.y - span.x, 0);
            }
        }
        slot_ranges[rank] = (uint2)(first_slot, slot);
    }
    chunk_ends[chunk] = slot;
    uint band_tiles = (band_last - band_first + 1) * tiles_x;
    __global uint *h = histogram + (size_t)chunk * band_tiles;
    for (uint tile = 0; tile < band_tiles; tile++) h[tile] = 0;
    for (uint i = chunk_starts[chunk]; i < slot; i++) h[(uint)emitted[i]]++;
}

__kernel void scatter_entries(uint chunks, uint band_tiles,
                              __global const uint *chunk_starts,       // [chunks+1]
                              __global const uint *chunk_ends,         // [chunks]
                              __global const ulong *emitted,           // [E], tile | position << 32
                              __global uint *histogram,                // [chunks,tiles]
                              __global const uint *tile_starts,        // [tiles+1]
                              __global uint2 *entries) {               // [E], (position, slot)
    uint chunk = get_global_id(0);
    if (chunk >= chunks) return;
    __global uint *h = histogram + (size_t)chunk * band_tiles;
    for (uint slot = chunk_starts[chunk]; slot < chunk_ends[chunk]; slot++) {
        uint tile = (uint)emitted[slot];
        entries[tile_starts[tile] + h[tile]++] = (uint2)(emitted[slot] >> 32, slot);
    }
}
#else
// The gpu style: one work-item per Gaussian, and the radix sort of sorting.cl in place of the counting sort.

// Bounds of the entries of each 256 visible Gaussians: for more than 2^32 in all, the image is split into bands.
__kernel void bound_entries(uint visible, uint groups,
                            __global const uint *order,  // [V]
                            __global const uint *areas,  // [K]
                            __global uint *bounds) {     // [groups,2], low and high half
    __local ulong sums[256];
    uint item = get_local_id(0), rank = get_global_id(0);
    sums[item] = rank < visible ? areas[order[rank]] : 0;
    for (uint step = 128; step > 0; step /= 2) {
        barrier(CLK_LOCAL_MEM_FENCE);
        if (item < step) sums[item] += sums[item + step];
    }
    if (item == 0 && get_group_id(0) < groups) vstore2((uint2)((uint)sums[0], (uint)(sums[0] >> 32)), get_group_id(0), bounds);
}

inline int2 span_of(const Footprint *f, __global const float *splat, int ty) {
    int begin, end;
    row_spans(f, ty, &begin, &end);
#if RAY
    if (f->unbounded) {
        int2 span = touched_span(splat, (int2)(begin, end), ty);
        begin = span.x, end = span.y;
    }
#endif
    return (int2)(begin, max(begin, end));
}

__kernel void count_entries(uint visible, int band_first, int band_last,
                            __global const uint *order,        // [V]
                            __global const float *splats,      // [K,SPLAT]
                            __global const float *footprints,  // [K,FOOTPRINT_FLOATS]
                            __global uint *counts) {           // [V]
    uint rank = get_global_id(0), count = 0;
    if (rank >= visible) return;
    Footprint f = load_footprint(vload8(order[rank], footprints), band_first, band_last);
    for (int ty = f.top; ty <= f.bottom; ty++) {
        int2 span = span_of(&f, splats + (size_t)SPLAT * order[rank], ty);
        count += span.y - span.x;
    }
    counts[rank] = count;
}

__kernel void emit_pairs(uint visible, int tiles_x, int band_first, int band_last,
                         __global const uint *order,         // [V]
                         __global const float *splats,       // [K,SPLAT]
                         __global const float *footprints,   // [K,FOOTPRINT_FLOATS]
                         __global const uint *first_slots,   // [V+1]
                         __global ulong *pairs,              // [E], tile << 32 | slot
                         __global uint *slot_positions,      // [E]
                         __global uint2 *slot_ranges) {      // [V]
    uint rank = get_global_id(0);
    if (rank >= visible) return;
    uint position = order[rank], slot = first_slots[rank];
    Footprint f = load_footprint(vload8(position, footprints), band_first, band_last);
    slot_ranges[rank] = (uint2)(slot, first_slots[rank + 1]);
    for (int ty = f.top; ty <= f.bottom; ty++) {
        int2 span = span_of(&f, splats + (size_t)SPLAT * position, ty);
        for (int tx = span.x; tx < span.y; tx++, slot++) {
            pairs[slot] = (ulong)((ty - band_first) * tiles_x + tx) << 32 | slot;
            slot_positions[slot] = position;
        }
    }
}
#endif
