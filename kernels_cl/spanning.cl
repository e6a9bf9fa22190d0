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
// Coordinates that are exact in single precision (SINGLES) are searched in it: only points within a bound, widened by the
// rounding of a distance, are compared in double precision. Bounds of components are in single precision, rounded up:
// atomic minima of 64 bits are an extension.
//
// PoCL does not inline built-in functions, so the inner loops use none.

#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#pragma OPENCL FP_CONTRACT OFF  // the same bits on every device

#define LOWER(a, b) ((a) < (b) ? (a) : (b))
#define HIGHER(a, b) ((a) > (b) ? (a) : (b))
#define UNROLL _Pragma("unroll")

#define NONE 0xffffffffu
#define LEAST_BOUND 1e-37  // of a component: devices may flush smaller single-precision numbers to zero

#if SINGLES
typedef float real;
typedef float16 real16;
typedef int2 mask2;
typedef int4 mask4;
typedef int8 mask8;
typedef int16 mask16;
#define TO_MASK(x) (x)
#define ROUNDED_DOWN(x) convert_float_rtn(x)
#define ROUNDING ((COLUMNS + 4) * 1.2e-7f)  // relative, of a squared distance
#else
typedef double real;
typedef double16 real16;
typedef long2 mask2;
typedef long4 mask4;
typedef long8 mask8;
typedef long16 mask16;
#define TO_MASK(x) convert_long16(x)
#define ROUNDED_DOWN(x) (x)
#define ROUNDING ((COLUMNS + 4) * 2.3e-16)
#endif

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

// Coordinates and boxes of the leaves; `blocks` are for exact distances, `searched` for the others.
__kernel void fill_leaves(uint count, uint levels,
                          __global const double *points,  // [N,COLUMNS]
                          __global const uint *order,     // [N]
                          __global double *blocks,        // [leaves,COLUMNS,LEAF]
                          __global real *searched,        // [leaves,COLUMNS,LEAF]
                          __global real *boxes) {        // [2 leaves,2,COLUMNS]
    uint leaf = get_global_id(0), leaves = 1u << levels;
    if (leaf >= leaves) return;
    uint begin = first_of(leaf, count, levels), end = first_of(leaf + 1, count, levels);
    size_t block = (size_t)leaf * COLUMNS * LEAF;
    __global real *box = boxes + (size_t)(leaves + leaf) * 2 * COLUMNS;
    for (uint c = 0; c < COLUMNS; c++) {
        real low = INFINITY, high = -INFINITY;
        for (uint i = 0; i < LEAF; i++) {
            double x = begin + i < end ? points[(size_t)order[begin + i] * COLUMNS + c] : INFINITY;
            blocks[block + c * LEAF + i] = x;
            searched[block + c * LEAF + i] = (real)x;
            if (begin + i < end) low = LOWER(low, (real)x), high = HIGHER(high, (real)x);
        }
        box[c] = low;
        box[COLUMNS + c] = high;
    }
}

__kernel void join_boxes(uint level,
                         __global real *boxes) {  // [2 leaves,2,COLUMNS]
    uint node = (1u << level) + get_global_id(0);
    if (node >= 2u << level) return;
    __global real *box = boxes + (size_t)node * 2 * COLUMNS, *left = boxes + (size_t)node * 4 * COLUMNS;
    __global real *right = left + 2 * COLUMNS;
    for (uint c = 0; c < COLUMNS; c++) {
        box[c] = LOWER(left[c], right[c]);
        box[COLUMNS + c] = HIGHER(left[COLUMNS + c], right[COLUMNS + c]);
    }
}

// The lanes of a mask, as bits.
inline uint bits_of(mask16 mask) {
    mask16 bits = mask & (mask16)(1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384, 32768);
    mask8 a = bits.lo | bits.hi;
    mask4 b = a.lo | a.hi;
    mask2 c = b.lo | b.hi;
    return c.x | c.y;
}

inline uint lowest_bit(uint bits) { return (as_uint((float)(bits & -bits)) >> 23) - 127; }

// The points of a leaf search together, each for squared distances below its bound; the bound of padding is 0.
typedef struct {
    real16 columns[COLUMNS];
    real16 bounds;  // `exact` ones and a distance's rounding
    double exact[LEAF];
} Searchers;

#define LANE(vector, lane) (((real *)&(vector))[lane])

inline void load_searchers(Searchers *s, __global const real *searched, uint leaf) {
    __global const real16 *block = (__global const real16 *)(searched + (size_t)leaf * COLUMNS * LEAF);
    for (uint c = 0; c < COLUMNS; c++) s->columns[c] = block[c];
}

inline void set_bound(Searchers *s, uint lane, double bound) {
    s->exact[lane] = bound;
    real above = (real)bound * (1 + 2 * ROUNDING);
    LANE(s->bounds, lane) = bound > 0.0 ? HIGHER(above, (real)LEAST_BOUND) : 0;
}

// Each searcher's squared distance to a node's box.
inline real16 box_distances(const Searchers *s, __global const real *boxes, uint node) {
    __global const real *box = boxes + (size_t)node * 2 * COLUMNS;
    real16 sum = (real16)0;
    UNROLL for (uint c = 0; c < COLUMNS; c++) {
        real16 below = box[c] - s->columns[c], above = s->columns[c] - box[COLUMNS + c];
        real16 gap = HIGHER(below, above);
        gap = HIGHER(gap, (real16)0);
        sum += gap * gap;
    }
    return sum;
}

// Squared distances of one searcher and the points of a leaf.
inline real16 distances(const Searchers *s, uint lane, __global const real *block) {
    real16 sum = (real16)0;
    UNROLL for (uint c = 0; c < COLUMNS; c++) {
        real16 difference = ((__global const real16 *)block)[c] - LANE(s->columns[c], lane);
        sum += difference * difference;
    }
    return sum;
}

// The exact squared distance of points of two leaves.
inline double exact_distance(__global const double *blocks, uint leaf, uint lane, uint other, uint i) {
    __global const double *a = blocks + (size_t)leaf * COLUMNS * LEAF + lane;
    __global const double *b = blocks + (size_t)other * COLUMNS * LEAF + i;
    double sum = 0.0;
    for (uint c = 0; c < COLUMNS; c++) {
        double difference = b[c * LEAF] - a[c * LEAF];
        sum += difference * difference;
    }
    return sum;
}

#define VECTORS ((NEIGHBOURS + 15) / 16)

// The nearest points so far, nearest first: NEIGHBOURS of them count.
typedef struct {
    double16 distances[VECTORS];
    uint16 points[VECTORS];
} Nearest;

#define FARTHEST(nearest) (((double *)(nearest)->distances)[NEIGHBOURS - 1])
#define BEHIND(carry, v) ((carry), (v).s0123, (v).s4567, (v).s89ab, (v).scde)

// Every farther entry moves by one place.
inline void insert(Nearest *nearest, double distance, uint point) {
    double carried = -1.0;
    uint carried_point = NONE;
    UNROLL for (uint v = 0; v < VECTORS; v++) {
        double16 old = nearest->distances[v], before = (double16)BEHIND(carried, old);
        uint16 points = nearest->points[v], points_before = (uint16)BEHIND(carried_point, points);
        carried = old.sf;
        carried_point = points.sf;
        nearest->distances[v] = old <= distance ? old : HIGHER(before, (double16)distance);
        nearest->points[v] = convert_uint16(old <= distance) ? points : convert_uint16(before > distance) ? points_before : (uint16)point;
    }
}

inline void look_for_nearer(Searchers *s, uint leaf, uint lane, Nearest *nearest, __global const double *blocks,
                            __global const real *searched, uint other, uint begin, uint self) {
    real16 squares = distances(s, lane, searched + (size_t)other * COLUMNS * LEAF);
    uint near = bits_of(squares < LANE(s->bounds, lane));
    if (!near) return;
    do {
        uint i = lowest_bit(near);
        near &= near - 1;
        double distance = exact_distance(blocks, leaf, lane, other, i);
        if (distance < FARTHEST(nearest) && begin + i != self) insert(nearest, distance, begin + i);
    } while (near);
    set_bound(s, lane, FARTHEST(nearest));
}

// The nodes that are still to be visited, with the searchers' distances to their boxes.
typedef struct {
    uint nodes[64];
    real16 distances[64];
    uint depth;
} Stack;

// Pushes a node if a point in it may be near enough.
inline void push(Stack *stack, const Searchers *s, __global const real *boxes, uint node) {
    real16 distances = box_distances(s, boxes, node);
    if (!bits_of(distances < s->bounds)) return;
    stack->nodes[stack->depth] = node;
    stack->distances[stack->depth++] = distances;
}

// Pushes the children of a node, or their children.
inline void push_below(Stack *stack, const Searchers *s, __global const real *boxes, uint node, uint leaves) {
    uint wide = 2 * node < leaves ? 4 : 2;
    for (uint child = wide * node; child < wide * (node + 1); child++) push(stack, s, boxes, child);
}

// The nearest points of each point, nearest first, up to its core distance (NONE beyond), and squared core distances. A
// point stands for `copies` coincident ones.
__kernel void find_neighbours(uint count, uint levels, uint min_samples,
                              __global const double *blocks,  // [leaves,COLUMNS,LEAF]
                              __global const real *searched,  // [leaves,COLUMNS,LEAF]
                              __global const real *boxes,    // [2 leaves,2,COLUMNS]
                              __global const uint *copies,    // [N]
                              __global uint *neighbours,      // [N,NEIGHBOURS]
                              __global double *core) {        // [N]
    uint leaf = get_global_id(0), leaves = 1u << levels;
    if (leaf >= leaves) return;
    uint begin = first_of(leaf, count, levels), size = first_of(leaf + 1, count, levels) - begin;
    Searchers s;
    Nearest nearest[LEAF];
    load_searchers(&s, searched, leaf);
    for (uint lane = 0; lane < LEAF; lane++) {
        set_bound(&s, lane, lane < size ? INFINITY : 0.0);
        if (lane >= size) continue;
        for (uint v = 0; v < VECTORS; v++) nearest[lane].distances[v] = INFINITY, nearest[lane].points[v] = NONE;
        look_for_nearer(&s, leaf, lane, &nearest[lane], blocks, searched, leaf, begin, begin + lane);
    }
    Stack stack;
    for (uint top = leaves + leaf; top > 1; top /= 2) {
        stack.depth = 0;
        push(&stack, &s, boxes, top ^ 1);
        while (stack.depth) {
            uint node = stack.nodes[--stack.depth];
            real16 away = stack.distances[stack.depth];
            if (!bits_of(away < s.bounds)) continue;
            if (node < leaves) {
                push_below(&stack, &s, boxes, node, leaves);
                continue;
            }
            uint other = node - leaves, first = first_of(other, count, levels);
            for (uint lane = 0; lane < size; lane++) {
                if (LANE(away, lane) < LANE(s.bounds, lane))
                    look_for_nearer(&s, leaf, lane, &nearest[lane], blocks, searched, other, first, NONE);
            }
        }
    }
    for (uint lane = 0; lane < size; lane++) {
        uint within = copies[begin + lane] - 1, i = 0;
        double distance = 0.0;
        const double *distances = (const double *)nearest[lane].distances;
        const uint *points = (const uint *)nearest[lane].points;
        for (; i < NEIGHBOURS && within < min_samples; i++) {
            distance = distances[i];
            within += copies[points[i]];
        }
        core[begin + lane] = distance;
        for (uint j = 0; j < NEIGHBOURS; j++) {
            neighbours[(size_t)(begin + lane) * NEIGHBOURS + j] = j < i ? points[j] : NONE;
        }
    }
}

// Core distances leaf by leaf, rounded down, and the least of each node.
__kernel void fill_cores(uint count, uint levels,
                         __global const double *core,    // [N]
                         __global real *cores,          // [leaves,LEAF]
                         __global real *least_cores) {  // [2 leaves]
    uint leaf = get_global_id(0), leaves = 1u << levels;
    if (leaf >= leaves) return;
    uint begin = first_of(leaf, count, levels), end = first_of(leaf + 1, count, levels);
    real least = INFINITY;
    for (uint i = 0; i < LEAF; i++) {
        real value = begin + i < end ? ROUNDED_DOWN(core[begin + i]) : INFINITY;
        cores[(size_t)leaf * LEAF + i] = value;
        least = LOWER(least, value);
    }
    least_cores[leaves + leaf] = least;
}

__kernel void join_cores(uint level,
                         __global real *least_cores) {  // [2 leaves]
    uint node = (1u << level) + get_global_id(0);
    if (node < 2u << level) least_cores[node] = LOWER(least_cores[2 * node], least_cores[2 * node + 1]);
}

// Components leaf by leaf, and that of each node: NONE where it holds several.
__kernel void fill_components(uint count, uint levels,
                              __global const uint *component,    // [N]
                              __global uint *components,         // [leaves,LEAF]
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
        for (uint i = 0; i < NEIGHBOURS && length > core[point]; i++) {  // no edge is shorter
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
                         __global const real *searched,         // [leaves,COLUMNS,LEAF]
                         __global const real *boxes,           // [2 leaves,2,COLUMNS]
                         __global const double *core,           // [N]
                         __global const real *cores,            // [leaves,LEAF]
                         __global const real *least_cores,      // [2 leaves]
                         __global const uint *components,       // [leaves,LEAF]
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
    uint16 lane_components = ((__global const uint16 *)components)[leaf];
    bool active = false;
    for (uint lane = 0; lane < LEAF; lane++) {
        set_bound(&s, lane, 0.0);
        if (lane >= size) continue;
        double bound = as_float(bounds[((uint *)&lane_components)[lane]]);
        bound = LOWER(bound, lengths[begin + lane]);
        if (least_lengths[begin + lane] >= bound) continue;
        set_bound(&s, lane, bound);
        active = true;
    }
    if (active) load_searchers(&s, searched, leaf);
    Stack stack;
    stack.depth = 0;
    uint top = leaves + leaf;
    if (active) push(&stack, &s, boxes, top);
    while (active) {
        if (!stack.depth) {
            if (top == 1) break;
            push(&stack, &s, boxes, top ^ 1);
            top /= 2;
            continue;
        }
        uint node = stack.nodes[--stack.depth];
        real16 away = stack.distances[stack.depth];
        real least_core = least_cores[node];
        uint common = node_components[node];
        mask16 near = (away < s.bounds) & (least_core < s.bounds);
        if (!bits_of(common == NONE ? near : near & TO_MASK(lane_components != common))) continue;
        if (node < leaves) {
            push_below(&stack, &s, boxes, node, leaves);
            continue;
        }
        uint other = node - leaves;
        real16 other_cores = ((__global const real16 *)cores)[other];
        uint16 other_components = ((__global const uint16 *)components)[other];
        for (uint lane = 0; lane < size; lane++) {
            if (LANE(away, lane) >= LANE(s.bounds, lane)) continue;
            uint lane_component = ((uint *)&lane_components)[lane];
            real16 length = distances(&s, lane, searched + (size_t)other * COLUMNS * LEAF);
            length = HIGHER(length, other_cores);
            uint shorter = bits_of((length < LANE(s.bounds, lane)) & TO_MASK(other_components != lane_component));
            uint first = first_of(other, count, levels);
            for (; shorter; shorter &= shorter - 1) {
                uint i = lowest_bit(shorter);
                double candidate = exact_distance(blocks, leaf, lane, other, i);
                candidate = HIGHER(candidate, HIGHER(core[begin + lane], core[first + i]));
                if (candidate >= s.exact[lane]) continue;
                partners[begin + lane] = first + i;
                lengths[begin + lane] = candidate;
                for (uint mate = 0; mate < size; mate++) {  // longer edges are useless to this component
                    if (((uint *)&lane_components)[mate] == lane_component && candidate < s.exact[mate])
                        set_bound(&s, mate, candidate);
                }
            }
        }
    }
    for (uint lane = 0; lane < size; lane++) {
        if (s.exact[lane] > 0.0) least_lengths[begin + lane] = s.exact[lane];
        lower_to(shortest + ((uint *)&lane_components)[lane], lengths[begin + lane]);
    }
}
