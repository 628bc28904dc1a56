#include "graph.hpp"

#include <nanobind/nanobind.h>
#include <nanobind/stl/vector.h>

#include <numeric>
#include <stdexcept>

#include "arrays.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace oath {

int Graph::add_node(Vec at) {
    nodes.push_back(at);
    arcs.emplace_back();
    return size() - 1;
}

int Graph::add_edge(int a, int b, int label_class) {
    if (a < 0 || b < 0 || a >= size() || b >= size() || a == b)
        throw std::invalid_argument("an edge joins two different nodes");
    const int edge = edges();
    from.push_back(a), to.push_back(b), label.push_back(label_class);
    arcs[a].push_back({b, edge});
    arcs[b].push_back({a, edge});
    for (auto& cost : costs) cost.push_back(kUnreachable);
    return edge;
}

namespace {

// A binary heap of (cost, node) with lazy deletion; flat and without bounds checks.
struct Queue {
    struct Entry {
        Cost cost;
        int node;
        bool operator<(const Entry& other) const { return cost > other.cost; }
    };
    std::vector<Entry> entries;
    void push(Cost cost, int node) {
        entries.push_back({cost, node});
        std::push_heap(entries.begin(), entries.end());
    }
    Entry pop() {
        std::pop_heap(entries.begin(), entries.end());
        const Entry top = entries.back();
        entries.pop_back();
        return top;
    }
};

}  // namespace

std::vector<Cost> Graph::travel(int mode, const std::vector<int>& sources,
                                const std::vector<int>& targets,
                                const std::vector<std::uint8_t>& allowed) const {
    // Arcs of this mode in one flat array: searched once for every source.
    std::vector<int> first(size() + 1, 0);
    struct Hop {
        int to;
        Cost cost;
    };
    std::vector<Hop> hops;
    hops.reserve(2 * from.size());
    for (int v = 0; v < size(); ++v) {
        for (const Arc& arc : arcs[v]) {
            const Cost c = costs[mode][arc.edge];
            if (c < kUnreachable && allowed[label[arc.edge]]) hops.push_back({arc.to, c});
        }
        first[v + 1] = static_cast<int>(hops.size());
    }
    std::vector<int> wanted(size(), 0);
    int distinct = 0;
    for (int t : targets)
        if (!wanted[t]++) ++distinct;

    std::vector<Cost> out(sources.size() * targets.size(), kUnreachable), best(size());
    Queue queue;
    for (std::size_t s = 0; s < sources.size(); ++s) {
        std::fill(best.begin(), best.end(), kUnreachable);
        queue.entries.clear();
        best[sources[s]] = 0;
        queue.push(0, sources[s]);
        int left = distinct;
        while (!queue.entries.empty()) {
            const auto [cost, v] = queue.pop();
            if (cost > best[v]) continue;
            if (wanted[v] && --left == 0) break;
            for (int i = first[v]; i < first[v + 1]; ++i) {
                const Cost c = cost + hops[i].cost;
                if (c < best[hops[i].to]) {
                    best[hops[i].to] = c;
                    queue.push(c, hops[i].to);
                }
            }
        }
        for (std::size_t t = 0; t < targets.size(); ++t)
            out[s * targets.size() + t] = best[targets[t]];
    }
    return out;
}

std::vector<int> Graph::nearest(Vec p, int k) const {
    std::vector<int> order(size());
    std::iota(order.begin(), order.end(), 0);
    k = std::min(k, size());
    std::vector<double> d(size());
    for (int v = 0; v < size(); ++v) d[v] = squared(nodes[v] - p);
    auto nearer = [&](int a, int b) { return d[a] < d[b] || (d[a] == d[b] && a < b); };
    std::nth_element(order.begin(), order.begin() + k, order.end(), nearer);
    order.resize(k);
    std::sort(order.begin(), order.end(), nearer);
    return order;
}

}  // namespace oath

void bind_graph(nb::module_& m) {
    using oath::Cost;
    using oath::Graph;
    m.attr("UNREACHABLE") = oath::kUnreachable;
    nb::class_<Graph>(m, "Graph",
                      "Roadmap: nodes [m], undirected edges, and a cost [um] per edge and mode.")
        .def(nb::init<int>(), "modes"_a)
        .def_prop_ro("size", &Graph::size, "Number of nodes.")
        .def_prop_ro("edges", &Graph::edges, "Number of edges.")
        .def(
            "add_nodes",
            [](Graph& self, Points at) {
                for (std::size_t i = 0; i < at.shape(0); ++i) self.add_node(vector(at, i));
            },
            "at"_a, "Append nodes (n, 2).")
        .def(
            "add_edges",
            [](Graph& self, Array<int> a, Array<int> b, Array<int> labels) {
                same_length(a, b), same_length(a, labels);
                for (std::size_t i = 0; i < a.shape(0); ++i)
                    self.add_edge(a.data()[i], b.data()[i], labels.data()[i]);
            },
            "a"_a, "b"_a, "labels"_a, "Append edges, unreachable in every mode.")
        .def(
            "set_costs",
            [](Graph& self, int mode, Array<int> edges, Array<Cost> costs) {
                same_length(edges, costs);
                auto& row = self.costs.at(mode);
                // Edges that cost nothing could support each other's values in a ring.
                for (std::size_t i = 0; i < costs.shape(0); ++i)
                    if (costs.data()[i] <= 0) throw std::invalid_argument("costs must be positive");
                for (std::size_t i = 0; i < edges.shape(0); ++i)
                    row.at(edges.data()[i]) = costs.data()[i];
            },
            "mode"_a, "edges"_a, "costs"_a, "Set the costs [um] of edges in a mode; at least 1, and no less than the straight line.")
        .def(
            "costs",
            [](const Graph& self, int mode) { return array(std::vector<Cost>(self.costs.at(mode))); },
            "mode"_a, "Costs [um] of all edges in a mode.")
        .def(
            "points",
            [](const Graph& self) {
                std::vector<double> out;
                out.reserve(2 * self.nodes.size());
                for (auto p : self.nodes) out.push_back(p.x), out.push_back(p.y);
                return array(std::move(out), {self.nodes.size(), 2});
            },
            "Positions (n, 2) of all nodes.")
        .def(
            "ends",
            [](const Graph& self) {
                std::vector<int> out;
                out.reserve(2 * self.from.size());
                for (int e = 0; e < self.edges(); ++e)
                    out.push_back(self.from[e]), out.push_back(self.to[e]);
                return array(std::move(out), {self.from.size(), 2});
            },
            "Nodes (m, 2) of all edges.")
        .def(
            "labels", [](const Graph& self) { return array(std::vector<int>(self.label)); },
            "Label class (m,) of all edges.")
        .def(
            "nearest",
            [](const Graph& self, double x, double y, int k) {
                return array(self.nearest({x, y}, k));
            },
            "x"_a, "y"_a, "k"_a, "The k nodes nearest to a point, nearest first.")
        .def(
            "travel",
            [](const Graph& self, int mode, std::vector<int> sources, std::vector<int> targets,
               std::vector<std::uint8_t> allowed) {
                if (mode < 0 || mode >= static_cast<int>(self.costs.size()))
                    throw std::out_of_range("no such mode");
                for (const auto* list : {&sources, &targets})
                    for (int v : *list)
                        if (v < 0 || v >= self.size()) throw std::out_of_range("no such node");
                for (int l : self.label)
                    if (l >= static_cast<int>(allowed.size()))
                        throw std::invalid_argument("allowed needs a flag for every label");
                const std::size_t n = sources.size(), k = targets.size();
                std::vector<Cost> out;
                {
                    nb::gil_scoped_release release;
                    out = self.travel(mode, sources, targets, allowed);
                }
                return array(std::move(out), {n, k});
            },
            "mode"_a, "sources"_a, "targets"_a, "allowed"_a,
            "Shortest costs (sources, targets) [um] over edges whose label is allowed; UNREACHABLE "
            "where there is no path.");
}
