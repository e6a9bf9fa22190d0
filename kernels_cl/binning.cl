// Binning: depth-ordered Gaussians -> one depth-ordered list per tile, for a band of tile rows.
//
// The visible Gaussians were sorted by depth once; a stable counting sort by tile keeps that order inside every list.
// The depth order is cut into `chunks` contiguous parts, one work-item each:
//   gather_footprints  footprints in depth order (once per frame), and how many entries a chunk can have at most: the
//                      area of its tile rectangles
//   bound_entries      the same of a band of tile rows, where they do not all fit
//   (host)             prefix sums: where each chunk's entries begin
//   emit_entries       walk the tiles of each Gaussian: its position and tile per entry, and the histogram of tiles
//   scan_chunks        (counting.cl), then prefix sums over the tiles on the host
//   scatter_entries    move the entries to their tiles' lists
// An entry's place of emission is its *slot*: slots of one Gaussian are contiguous, in tile order. Every entry has one
// slot and one place whatever the number of threads.

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

inline float half_width(const Footprint *p, float y) {
    float square = p->width2 * (1.0f - y * y * p->inverse_syy);
    return sqrt(square > 0.0f ? square : 0.0f);
}

// Tile columns [begin, end) of tile row `ty` (one of the rectangle's) that hold a pixel centre of the ellipse. Inlined by
// force: PoCL would call it, with the footprint in memory, at an eighth of the time of binning.
__attribute__((always_inline)) inline int2 row_span(const Footprint *p, int ty) {
    if (p->unbounded || p->first == p->last) return (int2)(p->first, p->last + 1);
    // The band of pixel centres, relative to the centre; x over it is extreme at the ellipse's own extreme points, or at
    // the band's edges.
    float low = ty * TILE + (0.5f - FOOTPRINT_MARGIN) - p->y, high = low + (TILE - 1 + 2.0f * FOOTPRINT_MARGIN);
    float y_left = CLAMP(-p->y_extreme, low, high), y_right = CLAMP(p->y_extreme, low, high);
    float left = p->x + (p->slope * y_left - half_width(p, y_left)) - FOOTPRINT_MARGIN;
    float right = p->x + (p->slope * y_right + half_width(p, y_right)) + FOOTPRINT_MARGIN;
    if (right < 0.0f) return (int2)(0, 0);
    float limit = (p->last + 1) * TILE;  // keeps the conversions to int defined
    left = CLAMP(left, 0.0f, limit);
    int first = left, last = right < limit ? right : limit;
    first += first < left;  // rounds up
    return (int2)(max(p->first, first / TILE), min(p->last, last / TILE) + 1);
}

#if RAY
// Largest value of c + b t + a t^2 for t in [low, high].
inline float largest(float a, float b, float c, float low, float high) {
    float t = a < 0.0f ? clamp(-0.5f * b / a, low, high) : low;
    return c + max(t * (b + a * t), high * (b + a * high));
}

// Whether a Gaussian that reaches behind the camera can touch a pixel of a tile. Its alpha >= ALPHA_MIN exactly where
// the quadratic g(d) = level N - Q (layout.cl) is not negative: a convex region around d = 0. So it meets the tile if it
// holds a point of the tile's boundary, or if the tile holds d = 0. Rays that meet the Gaussian behind the camera have
// 1 + linear < 0.
inline bool touches(__global const float *s, int tx, int ty) {
    float level = s[SPLAT_LOG2_OPACITY] - LOG2_ALPHA_MIN;
    float a = s[SPLAT_A], b = s[SPLAT_B], c = s[SPLAT_C];
    float xx = level * s[SPLAT_MXX] - a * a, yy = level * s[SPLAT_MYY] - (b * b + c * c);
    float xy = 2.0f * (level * s[SPLAT_MXY] - a * b);
    float lx = s[SPLAT_LX], ly = s[SPLAT_LY];
    float x[2], y[2], best = -INFINITY;
    x[0] = tx * TILE + (0.5f - FOOTPRINT_MARGIN) - s[SPLAT_U], x[1] = x[0] + (TILE - 1 + 2.0f * FOOTPRINT_MARGIN);
    y[0] = ty * TILE + (0.5f - FOOTPRINT_MARGIN) - s[SPLAT_V], y[1] = y[0] + (TILE - 1 + 2.0f * FOOTPRINT_MARGIN);
    if (x[0] <= 0.0f && x[1] >= 0.0f && y[0] <= 0.0f && y[1] >= 0.0f) return true;
    if (1.0f + max(lx * x[0], lx * x[1]) + max(ly * y[0], ly * y[1]) < 0.0f) return false;
    for (int side = 0; side < 2; side++) {
        float h = y[side], v = x[side];  // a horizontal and a vertical edge
        best = max(best, largest(xx, xy * h + 2.0f * level * lx, h * (yy * h + 2.0f * level * ly), x[0], x[1]));
        best = max(best, largest(yy, xy * v + 2.0f * level * ly, v * (xx * v + 2.0f * level * lx), y[0], y[1]));
    }
    float far_x = max(-x[0], x[1]), far_y = max(-y[0], y[1]);
    float rounding = 1e-6f * (fabs(xx) * far_x * far_x + fabs(xy) * far_x * far_y + fabs(yy) * far_y * far_y);
    return best + level > -1e-3f * level - rounding;
}
#endif

#define CHUNK_OF_VISIBLE                                        \
    uint chunk = get_global_id(0);                              \
    if (chunk >= chunks) return;                                \
    uint chunk_size = (visible + chunks - 1) / chunks;          \
    uint begin = min(chunk * chunk_size, visible), end = min(begin + chunk_size, visible);

inline uint tile_area(float8 footprint, int band_first, int band_last) {
    uint columns = as_uint(footprint.s5), rows = as_uint(footprint.s6);
    int top = max((int)(rows & 0xffff), band_first), bottom = min((int)(rows >> 16), band_last);
    return ((columns >> 16) - (columns & 0xffff) + 1) * max(bottom - top + 1, 0);
}

__kernel void gather_footprints(uint visible, uint chunks, __global const uint *order,
                                __global const float *footprints, __global float *ordered_footprints,
                                __global uint *bounds) {
    CHUNK_OF_VISIBLE
    uint area = 0;
    for (uint rank = begin; rank < end; rank++) {
        float8 footprint = vload8(order[rank], footprints);
        vstore8(footprint, rank, ordered_footprints);
        area += tile_area(footprint, 0, 0xffff);
    }
    bounds[chunk] = area;
}

__kernel void bound_entries(uint visible, uint chunks, int band_first, int band_last,
                            __global const float *ordered_footprints, __global uint *bounds) {
    CHUNK_OF_VISIBLE
    uint area = 0;
    for (uint rank = begin; rank < end; rank++)
        area += tile_area(vload8(rank, ordered_footprints), band_first, band_last);
    bounds[chunk] = area;
}

__kernel void emit_entries(uint visible, uint chunks, int tiles_x, int band_first, int band_last,
                           __global const uint *order, __global const float *splats,
                           __global const float *ordered_footprints, __global const uint *chunk_starts,
                           __global uint *chunk_ends, __global uint *emitted_tiles, __global uint *emitted_positions,
                           __global uint2 *slot_ranges, __global uint *histogram) {
    CHUNK_OF_VISIBLE
    uint band_tiles = (band_last - band_first + 1) * tiles_x;
    __global uint *h = histogram + (size_t)chunk * band_tiles;
    for (uint tile = 0; tile < band_tiles; tile++) h[tile] = 0;
    uint slot = chunk_starts[chunk];
    for (uint rank = begin; rank < end; rank++) {
        Footprint footprint = load_footprint(vload8(rank, ordered_footprints), band_first, band_last);
        uint position = order[rank], first_slot = slot;
        for (int ty = footprint.top; ty <= footprint.bottom; ty++) {
            int2 span = row_span(&footprint, ty);
            uint tile = (ty - band_first) * tiles_x + span.x;
            for (int tx = span.x; tx < span.y; tx++, tile++) {
#if RAY
                if (footprint.unbounded && !touches(splats + (size_t)SPLAT * position, tx, ty)) continue;
#endif
                h[tile]++;
                emitted_tiles[slot] = tile;
                emitted_positions[slot++] = position;
            }
        }
        slot_ranges[rank] = (uint2)(first_slot, slot);
    }
    chunk_ends[chunk] = slot;
}

__kernel void scatter_entries(uint chunks, uint band_tiles, __global const uint *chunk_starts,
                              __global const uint *chunk_ends, __global const uint *emitted_tiles,
                              __global const uint *emitted_positions, __global uint *histogram,
                              __global const uint *tile_starts, __global uint *entries, __global uint *slots) {
    uint chunk = get_global_id(0);
    if (chunk >= chunks) return;
    __global uint *h = histogram + (size_t)chunk * band_tiles;
    for (uint slot = chunk_starts[chunk]; slot < chunk_ends[chunk]; slot++) {
        uint tile = emitted_tiles[slot], place = tile_starts[tile] + h[tile]++;
        entries[place] = emitted_positions[slot];
        slots[place] = slot;
    }
}
