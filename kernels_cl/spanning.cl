// The minimum spanning tree under the mutual reachability distance (Campello et al. 2013), by Boruvka's algorithm on a
// balanced k-d tree, in double precision.
//
//   split_nodes                     level by level: the k-d tree
//   fill_leaves, join_boxes         coordinates by leaf, bounding boxes from the leaves up
//   find_neighbours                 nearest neighbours and core distances
//   fill_cores, join_cores          core distances by leaf, least ones from the leaves up
// and in each round, until one component is left:
//   fill_components, join_components  components by leaf, common ones from the leaves up
//   offer_edges                     an edge of each point out of its component, from its neighbours: an upper bound
//   find_edges                      the shortest edge of each component, by a search below these bounds
//
// N points, in the order of the tree after split_nodes.
//
// The tree is implicit: node 1 is the root, node n has children 2 n and 2 n + 1, and its 2^levels leaves are the
// last nodes. Leaf l holds the points at positions l count / 2^levels and on, at most LEAF = 16; its coordinates
// are a block [COLUMNS][LEAF], padded with infinity.
//
// Rounding never puts a box farther away than a point in it: rounded subtraction, multiplication and addition are monotonic,
// and both distances are summed in the same order. Bounds of components are in single precision, rounded up: atomic minima
// of 64 bits are an extension.
//
// PoCL does not inline built-in functions, so the inner loops use none.

#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#pragma OPENCL FP_CONTRACT OFF  // the same bits on every device

#define LOWER(a, b) ((a) < (b) ? (a) : (b))
#define HIGHER(a, b) ((a) > (b) ? (a) : (b))
#define UNROLL _Pragma("unroll")

#define NONE 0xffffffffu
#define LEAST_BOUND 1e-37  // of a component: devices may flush smaller single-precision numbers to zero

inline uint first_of(uint leaf, uint count, uint levels) { return (uint)((ulong)leaf * count >> levels); }

// Splits every node of a level at the median of its widest column: `order` gets the lower half first.
__kernel void split_nodes(uint count, uint levels, uint level,
                          __global const double *points,  // [N,COLUMNS]
                          __global uint *order,           // [N]
                          __global double *keys) {        // [N]
    uint node = get_global_id(0);
    if (node >= 1u << level) return;
    uint span = 1u << (levels - level);
    uint begin = first_of(node * span, count, levels), end = first_of((node + 1) * span, count, levels);
    uint nth = first_of(node * span + span / 2, count, levels);
    uint widest = 0;
    double width = -1.0;
    double low[COLUMNS], high[COLUMNS];
    for (uint c = 0; c < COLUMNS; c++) low[c] = INFINITY, high[c] = -INFINITY;
    for (uint i = begin; i < end; i++) {
        for (uint c = 0; c < COLUMNS; c++) {
            double x = points[(size_t)order[i] * COLUMNS + c];
            low[c] = x < low[c] ? x : low[c];
            high[c] = x > high[c] ? x : high[c];
        }
    }
    for (uint c = 0; c < COLUMNS; c++) {
        if (high[c] - low[c] > width) width = high[c] - low[c], widest = c;
    }
    for (uint i = begin; i < end; i++) keys[i] = points[(size_t)order[i] * COLUMNS + widest];
    long first = begin, last = (long)end - 1;
    while (first < last) {  // quickselect
        double a = keys[first], b = keys[(first + last) / 2], c = keys[last];
        double pivot = HIGHER(LOWER(a, b), LOWER(HIGHER(a, b), c));
        long i = first, j = last;
        while (i <= j) {
            while (keys[i] < pivot) i++;
            while (keys[j] > pivot) j--;
            if (i > j) break;
            double key = keys[i];
            keys[i] = keys[j];
            keys[j] = key;
            uint point = order[i];
            order[i++] = order[j];
            order[j--] = point;
        }
        if ((long)nth <= j) last = j;
        else if ((long)nth >= i) first = i;
        else break;
    }
}

// Coordinates and boxes of the leaves.
__kernel void fill_leaves(uint count, uint levels,
                          __global const double *points,  // [N,COLUMNS]
                          __global const uint *order,     // [N]
                          __global double *blocks,        // [leaves,COLUMNS,LEAF]
                          __global double *boxes) {        // [2 leaves,2,COLUMNS]
    uint leaf = get_global_id(0), leaves = 1u << levels;
    if (leaf >= leaves) return;
    uint begin = first_of(leaf, count, levels), end = first_of(leaf + 1, count, levels);
    __global double *block = blocks + (size_t)leaf * COLUMNS * LEAF;
    __global double *box = boxes + (size_t)(leaves + leaf) * 2 * COLUMNS;
    for (uint c = 0; c < COLUMNS; c++) {
        double low = INFINITY, high = -INFINITY;
        for (uint i = 0; i < LEAF; i++) {
            double x = begin + i < end ? points[(size_t)order[begin + i] * COLUMNS + c] : INFINITY;
            block[c * LEAF + i] = x;
            if (begin + i < end) low = LOWER(low, x), high = HIGHER(high, x);
        }
        box[c] = low;
        box[COLUMNS + c] = high;
    }
}

__kernel void join_boxes(uint level,
                         __global double *boxes) {  // [2 leaves,2,COLUMNS]
    uint node = (1u << level) + get_global_id(0);
    if (node >= 2u << level) return;
    __global double *box = boxes + (size_t)node * 2 * COLUMNS, *left = boxes + (size_t)node * 4 * COLUMNS;
    __global double *right = left + 2 * COLUMNS;
    for (uint c = 0; c < COLUMNS; c++) {
        box[c] = LOWER(left[c], right[c]);
        box[COLUMNS + c] = HIGHER(left[COLUMNS + c], right[COLUMNS + c]);
    }
}

inline bool any_of(long8 mask) {
    long4 a = mask.lo | mask.hi;
    long2 b = a.lo | a.hi;
    return (b.x | b.y) != 0;
}

inline bool any_of_16(long16 mask) { return any_of(mask.lo | mask.hi); }

// The points of a leaf search together, each for squared distances below its bound; the bound of padding is 0.
typedef struct {
    double16 columns[COLUMNS];
    double16 bounds;
    double16 distances;  // to the box at hand
} Searchers;

#define LANE(vector, lane) (((double *)&(vector))[lane])

inline void load_searchers(Searchers *s, __global const double *blocks, uint leaf) {
    __global const double16 *block = (__global const double16 *)(blocks + (size_t)leaf * COLUMNS * LEAF);
    for (uint c = 0; c < COLUMNS; c++) s->columns[c] = block[c];
}

// Writes each searcher's squared distance to a node's box.
inline void measure(Searchers *s, __global const double *boxes, uint node) {
    __global const double *box = boxes + (size_t)node * 2 * COLUMNS;
    double16 sum = (double16)0.0;
    UNROLL for (uint c = 0; c < COLUMNS; c++) {
        double16 below = box[c] - s->columns[c], above = s->columns[c] - box[COLUMNS + c];
        double16 gap = HIGHER(below, above);
        gap = HIGHER(gap, (double16)0.0);
        sum += gap * gap;
    }
    s->distances = sum;
}

// Squared distances of one searcher and eight points of a leaf.
inline double8 distances(const Searchers *s, uint lane, __global const double *block, uint v) {
    double8 sum = (double8)0.0;
    UNROLL for (uint c = 0; c < COLUMNS; c++) {
        double8 difference = ((__global const double8 *)block)[c * (LEAF / 8) + v] - LANE(s->columns[c], lane);
        sum += difference * difference;
    }
    return sum;
}

typedef struct {
    double distances[NEIGHBOURS];
    uint points[NEIGHBOURS];
} Nearest;

inline void look_for_nearer(Searchers *s, uint lane, Nearest *nearest, __global const double *block, uint begin, uint self) {
    UNROLL for (uint v = 0; v < LEAF / 8; v++) {
        double8 squares = distances(s, lane, block, v);
        if (!any_of(squares < nearest->distances[NEIGHBOURS - 1])) continue;
        for (uint i = 0; i < 8; i++) {
            double distance = ((double *)&squares)[i];
            if (!(distance < nearest->distances[NEIGHBOURS - 1]) || begin + v * 8 + i == self) continue;
            int place = NEIGHBOURS - 1;
            for (; place > 0 && nearest->distances[place - 1] > distance; place--) {
                nearest->distances[place] = nearest->distances[place - 1];
                nearest->points[place] = nearest->points[place - 1];
            }
            nearest->distances[place] = distance;
            nearest->points[place] = begin + v * 8 + i;
        }
    }
    LANE(s->bounds, lane) = nearest->distances[NEIGHBOURS - 1];
}

// The nearest points of each point, nearest first, up to its core distance (NONE beyond), and squared core distances. A
// point stands for `copies` coincident ones.
__kernel void find_neighbours(uint count, uint levels, uint min_samples,
                              __global const double *blocks,  // [leaves,COLUMNS,LEAF]
                              __global const double *boxes,    // [2 leaves,2,COLUMNS]
                              __global const uint *copies,    // [N]
                              __global uint *neighbours,      // [N,NEIGHBOURS]
                              __global double *core) {        // [N]
    uint leaf = get_global_id(0), leaves = 1u << levels;
    if (leaf >= leaves) return;
    uint begin = first_of(leaf, count, levels), size = first_of(leaf + 1, count, levels) - begin;
    Searchers s;
    Nearest nearest[LEAF];
    load_searchers(&s, blocks, leaf);
    for (uint lane = 0; lane < LEAF; lane++) {
        LANE(s.bounds, lane) = 0.0;
        if (lane >= size) continue;
        for (uint i = 0; i < NEIGHBOURS; i++) nearest[lane].distances[i] = INFINITY, nearest[lane].points[i] = NONE;
        look_for_nearer(&s, lane, &nearest[lane], blocks + (size_t)leaf * COLUMNS * LEAF, begin, begin + lane);
    }
    uint stack[64];
    for (uint top = leaves + leaf; top > 1; top /= 2) {
        uint depth = 1;
        stack[0] = top ^ 1;
        while (depth) {
            uint node = stack[--depth];
            measure(&s, boxes, node);
            if (!any_of_16(s.distances < s.bounds)) continue;
            if (node < leaves) {
                stack[depth++] = 2 * node;
                stack[depth++] = 2 * node + 1;
                continue;
            }
            uint other = node - leaves;
            for (uint lane = 0; lane < size; lane++) {
                if (LANE(s.distances, lane) >= LANE(s.bounds, lane)) continue;
                look_for_nearer(&s, lane, &nearest[lane], blocks + (size_t)other * COLUMNS * LEAF,
                                first_of(other, count, levels), NONE);
            }
        }
    }
    for (uint lane = 0; lane < size; lane++) {
        uint within = copies[begin + lane] - 1, i = 0;
        double distance = 0.0;
        for (; i < NEIGHBOURS && within < min_samples; i++) {
            distance = nearest[lane].distances[i];
            within += copies[nearest[lane].points[i]];
        }
        core[begin + lane] = distance;
        for (uint j = 0; j < NEIGHBOURS; j++) {
            neighbours[(size_t)(begin + lane) * NEIGHBOURS + j] = j < i ? nearest[lane].points[j] : NONE;
        }
    }
}

// Core distances leaf by leaf, and the least of each node.
__kernel void fill_cores(uint count, uint levels,
                         __global const double *core,    // [N]
                         __global double *cores,         // [leaves,LEAF]
                         __global double *least_cores) {  // [2 leaves]
    uint leaf = get_global_id(0), leaves = 1u << levels;
    if (leaf >= leaves) return;
    uint begin = first_of(leaf, count, levels), end = first_of(leaf + 1, count, levels);
    double least = INFINITY;
    for (uint i = 0; i < LEAF; i++) {
        double value = begin + i < end ? core[begin + i] : INFINITY;
        cores[(size_t)leaf * LEAF + i] = value;
        least = LOWER(least, value);
    }
    least_cores[leaves + leaf] = least;
}

__kernel void join_cores(uint level,
                         __global double *least_cores) {  // [2 leaves]
    uint node = (1u << level) + get_global_id(0);
    if (node < 2u << level) least_cores[node] = LOWER(least_cores[2 * node], least_cores[2 * node + 1]);
}

// Components leaf by leaf, and that of each node: NONE where it holds several.
__kernel void fill_components(uint count, uint levels,
                              __global const uint *component,    // [N]
                              __global long *components,         // [leaves,LEAF]
                              __global uint *node_components) {  // [2 leaves]
    uint leaf = get_global_id(0), leaves = 1u << levels;
    if (leaf >= leaves) return;
    uint begin = first_of(leaf, count, levels), end = first_of(leaf + 1, count, levels);
    uint common = component[begin];
    for (uint i = 0; i < LEAF; i++) {
        uint point = begin + i < end ? begin + i : begin;
        components[(size_t)leaf * LEAF + i] = component[point];
        if (component[point] != common) common = NONE;
    }
    node_components[leaves + leaf] = common;
}

__kernel void join_components(uint level,
                              __global uint *node_components) {  // [2 leaves]
    uint node = (1u << level) + get_global_id(0);
    if (node >= 2u << level) return;
    uint left = node_components[2 * node], right = node_components[2 * node + 1];
    node_components[node] = left == right ? left : NONE;
}

inline void lower_to(__global uint *bound, double distance) {
    float above = convert_float_rtp(HIGHER(distance, LEAST_BOUND));
    atomic_min(bound, as_uint(above));  // non-negative floats are ordered as their bits
}

inline double separation(__global const double *points, uint a, uint b) {
    double sum = 0.0;
    for (uint c = 0; c < COLUMNS; c++) {
        double difference = points[(size_t)a * COLUMNS + c] - points[(size_t)b * COLUMNS + c];
        sum += difference * difference;
    }
    return sum;
}

// A short edge of each point that leaves its component: that of the last round if it still does, else the shortest to a
// neighbour, else to a neighbour in the tree's order.
// partners, lengths: the other end (or NONE) and the squared length of the edge.
// bounds: the least length by component, as the bits of a float, rounded up.
__kernel void offer_edges(uint count,
                          __global const double *points,    // [N,COLUMNS]
                          __global const uint *order,       // [N]
                          __global const uint *neighbours,  // [N,NEIGHBOURS]
                          __global const double *core,      // [N]
                          __global const uint *component,   // [N]
                          __global uint *partners,          // [N]
                          __global double *lengths,         // [N]
                          __global uint *bounds) {          // [components]
    uint point = get_global_id(0);
    if (point >= count) return;
    uint from = component[point], partner = partners[point];
    double length = lengths[point];
    if (partner != NONE && component[partner] == from) partner = NONE, length = INFINITY;
    if (partner == NONE) {
        for (uint i = 0; i < NEIGHBOURS; i++) {
            uint other = neighbours[(size_t)point * NEIGHBOURS + i];
            if (other == NONE) break;
            double offered = HIGHER(core[point], core[other]);
            if (component[other] != from && offered < length) partner = other, length = offered;
        }
        for (int step = -1; step <= 1 && partner == NONE; step += 2) {
            uint other = point + step;  // wraps to a large number below 0
            if (other >= count || component[other] == from) continue;
            length = separation(points, order[point], order[other]);
            length = HIGHER(length, HIGHER(core[point], core[other]));
            partner = other;
        }
        partners[point] = partner;
        lengths[point] = length;
    }
    if (partner != NONE) lower_to(bounds + from, length);
}

// The shortest edge of each component: every point searches below the bound of its component.
// least_lengths: a lower bound for the point's edges that leave its component.
// shortest: the lengths of the edges that remain, as `bounds`.
__kernel void find_edges(uint count, uint levels,
                         __global const double *blocks,         // [leaves,COLUMNS,LEAF]
                         __global const double *boxes,           // [2 leaves,2,COLUMNS]
                         __global const double *cores,          // [leaves,LEAF]
                         __global const double *least_cores,     // [2 leaves]
                         __global const long *components,       // [leaves,LEAF]
                         __global const uint *node_components,  // [2 leaves]
                         __global const uint *bounds,           // [components]
                         __global uint *partners,               // [N]
                         __global double *lengths,              // [N]
                         __global double *least_lengths,        // [N]
                         __global uint *shortest) {             // [components]
    uint leaf = get_global_id(0), leaves = 1u << levels;
    if (leaf >= leaves) return;
    uint begin = first_of(leaf, count, levels), size = first_of(leaf + 1, count, levels) - begin;
    Searchers s;
    long16 lane_components;
    bool active = false;
    for (uint lane = 0; lane < LEAF; lane++) {
        uint component = components[(size_t)leaf * LEAF + lane];
        ((long *)&lane_components)[lane] = component;
        LANE(s.bounds, lane) = 0.0;
        if (lane >= size) continue;
        double bound = as_float(bounds[component]);
        bound = LOWER(bound, lengths[begin + lane]);
        if (least_lengths[begin + lane] >= bound) continue;
        LANE(s.bounds, lane) = bound;
        active = true;
    }
    if (active) load_searchers(&s, blocks, leaf);
    uint stack[64], depth = 1, top = leaves + leaf;
    stack[0] = top;
    while (active) {
        if (!depth) {
            if (top == 1) break;
            stack[depth++] = top ^ 1;
            top /= 2;
        }
        uint node = stack[--depth];
        measure(&s, boxes, node);
        double least_core = least_cores[node];
        long common = node_components[node];
        long16 near = (s.distances < s.bounds) & (least_core < s.bounds);
        if (!any_of_16(common == NONE ? near : near & (lane_components != common))) continue;
        if (node < leaves) {
            stack[depth++] = 2 * node;
            stack[depth++] = 2 * node + 1;
            continue;
        }
        uint other = node - leaves;
        for (uint lane = 0; lane < size; lane++) {
            if (LANE(s.distances, lane) >= LANE(s.bounds, lane)) continue;
            __global const double8 *core = (__global const double8 *)cores + other * (LEAF / 8);
            __global const long8 *component = (__global const long8 *)components + other * (LEAF / 8);
            long lane_component = ((long *)&lane_components)[lane];
            double lane_core = cores[(size_t)leaf * LEAF + lane];
            UNROLL for (uint v = 0; v < LEAF / 8; v++) {
                double8 length = distances(&s, lane, blocks + (size_t)other * COLUMNS * LEAF, v);
                length = HIGHER(length, core[v]);
                length = HIGHER(length, lane_core);
                long8 shorter = (length < LANE(s.bounds, lane)) & (component[v] != lane_component);
                if (!any_of(shorter)) continue;
                for (uint i = 0; i < 8; i++) {
                    double candidate = ((double *)&length)[i];
                    if (!((long *)&shorter)[i] || candidate >= LANE(s.bounds, lane)) continue;
                    partners[begin + lane] = first_of(other, count, levels) + v * 8 + i;
                    lengths[begin + lane] = candidate;
                    for (uint mate = 0; mate < size; mate++) {  // longer edges are useless to this component
                        if (((long *)&lane_components)[mate] == lane_component && candidate < LANE(s.bounds, mate))
                            LANE(s.bounds, mate) = candidate;
                    }
                }
            }
        }
    }
    for (uint lane = 0; lane < size; lane++) {
        if (LANE(s.bounds, lane) > 0.0) least_lengths[begin + lane] = LANE(s.bounds, lane);
        lower_to(shortest + ((long *)&lane_components)[lane], lengths[begin + lane]);
    }
}
