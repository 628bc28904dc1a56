// The roadmap as a graph: nodes are only ever appended, edges carry one cost per mode of travel.
#pragma once

#include <cstdint>
#include <vector>

#include "geometry.hpp"

namespace oath {

using Cost = std::int64_t;  // micrometres

// Larger than any path, and small enough that a few of them can be added.
constexpr Cost kUnreachable = INT64_MAX / 8;

// Edges round up and straight lines down, so that the straight line never exceeds a path.
inline Cost line_cost(Vec a, Vec b) { return static_cast<Cost>(std::floor(distance(a, b) * 1e6)); }

struct Arc {
    int to;
    int edge;
};

struct Graph {
    std::vector<Vec> nodes;
    std::vector<std::vector<Arc>> arcs;         // by node
    std::vector<int> from, to;                  // by edge
    std::vector<int> label;                     // by edge: which set of atoms driving it makes true
    std::vector<std::vector<Cost>> costs;       // by mode, by edge

    explicit Graph(int modes) : costs(modes) {}

    int size() const { return static_cast<int>(nodes.size()); }
    int edges() const { return static_cast<int>(from.size()); }

    int add_node(Vec at);
    int add_edge(int a, int b, int label_class);

    // Shortest costs from each source to each target; labels flagged 0 may not be driven.
    std::vector<Cost> travel(int mode, const std::vector<int>& sources,
                             const std::vector<int>& targets,
                             const std::vector<std::uint8_t>& allowed) const;

    // The k nodes nearest to a point, nearest first.
    std::vector<int> nearest(Vec p, int k) const;
};

}  // namespace oath
