// Binning: depth-ordered Gaussians -> one depth-ordered list per tile, for a band of tile rows.
//
// The visible Gaussians were sorted by depth once; a stable counting sort by tile keeps that order inside every list.
// The depth order is cut into `chunks` contiguous parts, one work-item each:
//   count_tiles    histogram of its part per tile, and the number of tiles of each Gaussian
//   scan_chunks    per tile: exclusive sums over the chunks, and the tile's total (counting.cl)
//   (host)         prefix sums: first entry of each tile, first slot of each Gaussian
//   scatter_tiles  write the entries: which Gaussian, and the slot that keeps its partial sums in Gaussian order
// Both passes walk the same tiles, so every entry has one place whatever the number of threads.

typedef struct {
    float x, y, slope, width2, inverse_syy, extent_y, y_extreme;
    int first, last, top, bottom;  // tile rectangle, inclusive
    bool whole;                    // every tile of the rectangle is touched
} Footprint;

inline Footprint load_footprint(float8 f, int band_first, int band_last) {
    Footprint p;
    float sxx = f.s2, sxy = f.s3, syy = f.s4;
    p.x = f.s0 - 0.5f;
    p.y = f.s1;
    p.inverse_syy = 1.0f / syy;
    p.slope = sxy * p.inverse_syy;
    p.width2 = max(sxx - sxy * p.slope, 0.0f);
    p.extent_y = sqrt(syy);
    p.y_extreme = sxy * rsqrt(sxx);  // where the ellipse reaches furthest in x
    uint columns = as_uint(f.s5), rows = as_uint(f.s6);
    p.first = columns & 0xffff;
    p.last = columns >> 16;
    p.top = max((int)(rows & 0xffff), band_first);
    p.bottom = min((int)(rows >> 16), band_last);
    p.whole = p.first == p.last || isinf(sxx);
    return p;
}

// Tile columns [begin, end) of tile row `ty` that hold a pixel centre of the ellipse.
inline int2 row_span(const Footprint *p, int ty) {
    if (p->whole) return (int2)(p->first, p->last + 1);
    // The band of pixel centres, relative to the centre; x over it is extreme at the ellipse's own extreme points, or at
    // the band's edges.
    float low = ty * TILE + (0.5f - FOOTPRINT_MARGIN) - p->y, high = low + (TILE - 1 + 2.0f * FOOTPRINT_MARGIN);
    if (low > p->extent_y || high < -p->extent_y) return (int2)(0, 0);
    float y_right = clamp(p->y_extreme, low, high), y_left = clamp(-p->y_extreme, low, high);
    float right = p->slope * y_right + sqrt(max(p->width2 * (1.0f - y_right * y_right * p->inverse_syy), 0.0f));
    float left = p->slope * y_left - sqrt(max(p->width2 * (1.0f - y_left * y_left * p->inverse_syy), 0.0f));
    float limit = (p->last + 1) * TILE;  // keeps the conversion to int defined
    int first = (int)ceil(clamp(p->x + left - FOOTPRINT_MARGIN, 0.0f, limit)) / TILE;
    int last = (int)floor(clamp(p->x + right + FOOTPRINT_MARGIN, -1.0f, limit));
    if (last < 0) return (int2)(0, 0);
    return (int2)(max(p->first, first), min(p->last, last / TILE) + 1);
}

__kernel void count_tiles(uint visible, uint chunks, int tiles_x, int band_first, int band_last,
                          __global const uint *order, __global const float *footprints,
                          __global float *ordered_footprints, __global uint *counts, __global uint *histogram) {
    uint chunk = get_global_id(0);
    if (chunk >= chunks) return;
    uint size = (visible + chunks - 1) / chunks, begin = min(chunk * size, visible), end = min(begin + size, visible);
    uint band_tiles = (band_last - band_first + 1) * tiles_x;
    __global uint *h = histogram + (size_t)chunk * band_tiles;
    for (uint tile = 0; tile < band_tiles; tile++) h[tile] = 0;
    // A loop of its own, so that its cache misses overlap; the branches below would serialize them.
    for (uint rank = begin; rank < end; rank++) vstore8(vload8(order[rank], footprints), rank, ordered_footprints);
    for (uint rank = begin; rank < end; rank++) {
        Footprint footprint = load_footprint(vload8(rank, ordered_footprints), band_first, band_last);
        uint count = 0;
        for (int ty = footprint.top; ty <= footprint.bottom; ty++) {
            int2 span = row_span(&footprint, ty);
            __global uint *row = h + (ty - band_first) * tiles_x;
            for (int tx = span.x; tx < span.y; tx++) row[tx]++;
            count += max(span.y - span.x, 0);
        }
        counts[rank] = count;
    }
}

__kernel void scatter_tiles(uint visible, uint chunks, int tiles_x, int band_first, int band_last,
                            __global const uint *order, __global const float *ordered_footprints,
                            __global uint *histogram, __global const uint *tile_starts,
                            __global const uint *slot_starts, __global uint *entries, __global uint *slots) {
    uint chunk = get_global_id(0);
    if (chunk >= chunks) return;
    uint size = (visible + chunks - 1) / chunks, begin = min(chunk * size, visible), end = min(begin + size, visible);
    uint band_tiles = (band_last - band_first + 1) * tiles_x;
    __global uint *h = histogram + (size_t)chunk * band_tiles;
    for (uint rank = begin; rank < end; rank++) {
        Footprint footprint = load_footprint(vload8(rank, ordered_footprints), band_first, band_last);
        uint row = order[rank], slot = slot_starts[rank];
        for (int ty = footprint.top; ty <= footprint.bottom; ty++) {
            int2 span = row_span(&footprint, ty);
            uint tile = (ty - band_first) * tiles_x + span.x;
            for (int tx = span.x; tx < span.y; tx++, tile++) {
                uint entry = tile_starts[tile] + h[tile]++;
                entries[entry] = row;
                slots[entry] = slot++;
            }
        }
    }
}
