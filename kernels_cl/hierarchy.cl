// HDBSCAN's condensed hierarchy of a spanning tree, from the bottom up, by one work-item.
//
// Edges come in levels of equal length, and the edges of a level join at once (Campello et al. 2013, algorithm 1, removes
// them at once), so the result does not depend on their order. A component of at least min_cluster_size points is a
// cluster. A level that joins
//   two clusters or more  makes a new cluster, their parent; smaller components belong to the parent
//   one cluster           adds the points of smaller components to it
//   none                  makes a cluster if the sum is large enough
// Clusters are numbered as they form, so children come before their parents, and the last one is the root.

#define NONE 0xffffffffu

inline uint find(__global uint *up, uint point) {
    while (up[point] != point) {
        up[point] = up[up[point]];
        point = up[point];
    }
    return point;
}

// Of a component, at its root: up (parent in the union-find forest), sizes (points), clusters, heads and tails (first and
// last point without a cluster), merged (cluster after the current level). next: next point without a cluster.
__kernel void condense(uint count, uint levels, uint min_cluster_size,
                       __global uint2 *edges,              // [K-1]
                       __global const uint *level_starts,  // [levels+1]
                       __global uint *up,                  // [K]
                       __global uint *sizes,               // [K]
                       __global uint *clusters,            // [K]
                       __global uint *heads,               // [K]
                       __global uint *tails,               // [K]
                       __global uint *next,                // [K]
                       __global uint *merged,              // [K]
                       __global uint *joined,              // [K]
                       __global uint *point_clusters,      // [K]
                       __global uint *point_levels,        // [K]
                       __global uint *parents,             // [clusters]
                       __global uint *parent_levels,       // [clusters]
                       __global uint *cluster_count) {     // [1]
    for (uint point = 0; point < count; point++) {
        up[point] = heads[point] = tails[point] = point;
        clusters[point] = next[point] = NONE;
        sizes[point] = 1;
    }
    uint formed = 0, placed = 0;
    for (uint level = 0; level < levels; level++) {
        uint begin = level_starts[level], end = level_starts[level + 1], formed_before = formed;
        for (uint e = begin; e < end; e++) {  // from points to components
            edges[e] = (uint2)(find(up, edges[e].x), find(up, edges[e].y));
        }
        for (uint e = begin; e < end; e++) {
            uint a = find(up, edges[e].x), b = find(up, edges[e].y), large = sizes[a] < sizes[b] ? b : a;
            up[a == large ? b : a] = large;
            sizes[large] = sizes[a] + sizes[b];
        }
        for (uint e = begin; e < end; e++) merged[find(up, edges[e].x)] = NONE;
        for (uint i = 2 * begin; i < 2 * end; i++) {
            uint part = ((__global uint *)edges)[i], whole = find(up, part);
            if (clusters[part] == NONE || clusters[part] == merged[whole]) continue;
            if (merged[whole] == NONE) merged[whole] = clusters[part];
            else if (merged[whole] < formed_before) merged[whole] = formed++;
        }
        for (uint i = 2 * begin; i < 2 * end; i++) {
            uint part = ((__global uint *)edges)[i], whole = find(up, part);
            if (merged[whole] == NONE && sizes[whole] >= min_cluster_size) merged[whole] = formed++;
            uint cluster = merged[whole];
            if (clusters[part] != NONE) {
                if (clusters[part] != cluster) {
                    parents[clusters[part]] = cluster;
                    parent_levels[clusters[part]] = level;
                }
            } else if (cluster != NONE) {
                for (uint point = heads[part]; point != NONE; point = next[point]) {
                    joined[placed++] = point;
                    point_clusters[point] = cluster;
                    point_levels[point] = level;
                }
                heads[part] = NONE;
            } else if (part != whole && heads[part] != NONE) {
                next[tails[whole]] = heads[part];
                tails[whole] = tails[part];
                heads[part] = NONE;
            }
        }
        for (uint e = begin; e < end; e++) {
            uint whole = find(up, edges[e].x);
            clusters[whole] = merged[whole];
        }
    }
    parents[formed - 1] = NONE;
    *cluster_count = formed;
}
