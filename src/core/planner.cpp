#include "planner.hpp"

#include <nanobind/nanobind.h>
#include <nanobind/stl/vector.h>

#include <stdexcept>

#include "arrays.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace oath {

namespace {

constexpr long kLeast = 64;  // a repair may always take so many expansions

Cost add(Cost a, Cost b) {
    return a >= kUnreachable || b >= kUnreachable ? kUnreachable : a + b;
}

}  // namespace

Drive::Drive(int states, int labels, const std::uint8_t* table)
    : states(states), labels(labels), next(labels * states), before(labels * states) {
    for (int l = 0; l < labels; ++l)
        for (int q = 0; q < states; ++q)
            for (int p = 0; p < states; ++p)
                if (table[(static_cast<std::size_t>(l) * states + q) * states + p]) {
                    next[l * states + q].push_back(p);
                    before[l * states + p].push_back(q);
                }
}

Leg::Leg(const Graph& graph, int mode, const Drive& drive, int target)
    : graph_(&graph), mode_(mode), drive_(&drive), target_(target), ends_(drive.states, 0) {}

void Leg::grow() {
    const std::size_t size = static_cast<std::size_t>(graph_->size()) * drive_->states;
    if (states_.size() < size) states_.resize(size, State{kUnreachable, kUnreachable, -1, 0});
}

Leg::State& Leg::touch(int s) {
    State& state = states_[s];
    if (state.epoch != epoch_) state = {kUnreachable, kUnreachable, -1, epoch_};
    return state;
}

Cost Leg::end(int s) const {
    return s / drive_->states == target_ ? ends_[s % drive_->states] : kUnreachable;
}

Cost Leg::best(int s) const {
    const int n = drive_->states, v = s / n, q = s % n;
    const auto& costs = graph_->costs[mode_];
    Cost least = end(s);
    for (const Arc& arc : graph_->arcs[v]) {
        const Cost c = costs[arc.edge];
        if (c >= kUnreachable) continue;
        for (int p : drive_->next[graph_->label[arc.edge] * n + q])
            least = std::min(least, add(g(arc.to * n + p), c));
    }
    return least;
}

Key Leg::key(int s) const {
    const Cost least = std::min(g(s), rhs(s));
    if (least >= kUnreachable) return {kUnreachable, kUnreachable};
    const Vec at = graph_->nodes[s / drive_->states];
    return {least + line_cost(at_, at) + offset_, least};
}

void Leg::set_ends(const std::vector<Cost>& ends) {
    if (ends == ends_ && !fresh_) return;
    ends_ = ends;
    if (fresh_) return;
    grow();
    renew(target_);
}

// Look at a node anew after what follows it changed.
void Leg::renew(int node) {
    for (int q = 0; q < drive_->states; ++q) {
        const int s = node * drive_->states + q;
        const Cost least = best(s);
        if (least != rhs(s)) {
            touch(s).rhs = least;
            update(s);
        }
    }
}

void Leg::set_start(Vec at, std::vector<Link> links, std::vector<int> states, bool each) {
    // Old keys must stay lower bounds, though a line's cost may be one too low, and by rounding two.
    if (!fresh_) offset_ += line_cost(at_, at) + 2;
    at_ = at, links_ = std::move(links), starts_ = std::move(states), each_ = each;
}

void Leg::changed(const std::vector<int>& edges) {
    // To look at so many nodes anew would take longer than a search from scratch.
    if (static_cast<long>(edges.size()) > 4 * std::max(scratch_, kLeast)) fresh_ = true;
    if (fresh_) return;
    grow();
    for (int e : edges) renew(graph_->from[e]), renew(graph_->to[e]);
}

void Leg::restart() {
    if (++epoch_ == 0) {  // wrapped around: old stamps would look current
        states_.assign(states_.size(), State{kUnreachable, kUnreachable, -1, 0});
        epoch_ = 1;
    }
    heap_.clear();
    offset_ = 0;
    fresh_ = false;
    for (int q = 0; q < drive_->states; ++q)
        if (ends_[q] < kUnreachable) {
            const int s = target_ * drive_->states + q;
            touch(s).rhs = ends_[q];
            push(s, key(s));
        }
}

void Leg::search() {
    grow();
    if (!fresh_ && run(std::max(scratch_, kLeast))) return;
    restart();
    const long before = expanded_;
    run(-1);
    scratch_ = expanded_ - before;
}

Cost Leg::enter(int q, const Link& link) const {
    Cost least = kUnreachable;
    if (link.label < 0) {  // the robot stands on the node: nothing is driven
        least = g(link.node * drive_->states + q);
    } else {
        for (int p : drive_->next[link.label * drive_->states + q])
            least = std::min(least, g(link.node * drive_->states + p));
    }
    return add(least, link.cost);
}

std::vector<int> Leg::entries() const {
    std::vector<int> out;
    for (const Link& link : links_) {
        if (link.cost >= kUnreachable) continue;
        for (int q : starts_) {
            if (link.label < 0) {
                out.push_back(link.node * drive_->states + q);
            } else {
                for (int p : drive_->next[link.label * drive_->states + q])
                    out.push_back(link.node * drive_->states + p);
            }
        }
    }
    return out;
}

Cost Leg::value(int q) const {
    Cost least = kUnreachable;
    for (const Link& link : links_) least = std::min(least, enter(q, link));
    return least;
}

Cost Leg::bound() const {
    Cost least = kUnreachable, most = 0;
    for (int q : starts_) {
        const Cost c = value(q);
        least = std::min(least, c);
        most = std::max(most, c);
    }
    return each_ ? most : least;
}

bool Leg::run(long limit) {
    long left = limit;
    while (!heap_.empty() && heap_[0].key.first < kUnreachable) {
        const Cost goal = bound();
        if (goal < kUnreachable && Key{goal + offset_, goal} < heap_[0].key) break;
        if (limit >= 0 && left-- == 0) return false;
        ++expanded_;
        const int s = heap_[0].state;
        const Key now = key(s);
        if (heap_[0].key < now) {
            put(0, {now, s});
            down(0);
        } else {
            expand(s);
        }
    }
    return true;
}

void Leg::expand(int s) {
    const int n = drive_->states, v = s / n, q = s % n;
    const auto& costs = graph_->costs[mode_];
    State& state = states_[s];
    const Cost old = state.g;
    const bool over = old > state.rhs;
    if (over) {
        state.g = state.rhs;
        remove(s);
    } else {
        state.g = kUnreachable;
    }
    for (const Arc& arc : graph_->arcs[v]) {
        const Cost c = costs[arc.edge];
        if (c >= kUnreachable) continue;
        for (int p : drive_->before[graph_->label[arc.edge] * n + q]) {
            const int t = arc.to * n + p;
            if (over) {
                const Cost through = states_[s].g + c;
                if (through < rhs(t)) {
                    touch(t).rhs = through;
                    update(t);
                }
            } else if (rhs(t) == old + c) {
                touch(t).rhs = best(t);
                update(t);
            }
        }
    }
    if (!over) update(s);
}

void Leg::update(int s) {
    State& state = states_[s];
    if (state.g == state.rhs) {
        if (state.place >= 0) remove(s);
    } else if (state.place >= 0) {
        const Key now = key(s);
        const int place = state.place;
        const bool rises = now < heap_[place].key;
        put(place, {now, s});
        rises ? up(place) : down(place);
    } else {
        push(s, key(s));
    }
}

// The heap is 4-ary: fewer cache misses than a binary one on keys of this size.
void Leg::put(int place, Item item) {
    heap_[place] = item;
    states_[item.state].place = place;
}

void Leg::push(int s, Key key) {
    heap_.push_back({key, s});
    states_[s].place = static_cast<int>(heap_.size()) - 1;
    up(states_[s].place);
}

void Leg::remove(int s) {
    const int place = states_[s].place;
    states_[s].place = -1;
    const Item last = heap_.back();
    heap_.pop_back();
    if (last.state == s) return;
    put(place, last);
    up(place);
    down(states_[last.state].place);
}

void Leg::up(int place) {
    const Item item = heap_[place];
    while (place > 0) {
        const int parent = (place - 1) / 4;
        if (!(item.key < heap_[parent].key)) break;
        put(place, heap_[parent]);
        place = parent;
    }
    put(place, item);
}

void Leg::down(int place) {
    const Item item = heap_[place];
    const int size = static_cast<int>(heap_.size());
    for (;;) {
        const int first = 4 * place + 1;
        if (first >= size) break;
        int least = first;
        for (int c = first + 1; c < std::min(first + 4, size); ++c)
            if (heap_[c].key < heap_[least].key) least = c;
        if (!(heap_[least].key < item.key)) break;
        put(place, heap_[least]);
        place = least;
    }
    put(place, item);
}

std::vector<std::pair<int, int>> Leg::path(int q) const {
    const int n = drive_->states;
    const auto& costs = graph_->costs[mode_];
    const Cost total = value(q);
    std::vector<std::pair<int, int>> out;
    if (total >= kUnreachable) return out;
    int v = -1;
    for (const Link& link : links_) {
        if (v >= 0) break;
        if (link.label < 0) {
            if (add(g(link.node * n + q), link.cost) == total) v = link.node;
            continue;
        }
        for (int p : drive_->next[link.label * n + q])
            if (v < 0 && add(g(link.node * n + p), link.cost) == total) v = link.node, q = p;
    }
    out.push_back({v, q});
    // Costs are integers, so the way down is exact; its length is bounded by the number of states.
    for (std::size_t guard = states_.size(); guard > 0; --guard) {
        const int s = v * n + q;
        const Cost here = g(s);
        if (end(s) <= here) return out;
        bool found = false;
        for (const Arc& arc : graph_->arcs[v]) {
            const Cost c = costs[arc.edge];
            if (c >= kUnreachable) continue;
            for (int p : drive_->next[graph_->label[arc.edge] * n + q])
                if (!found && add(g(arc.to * n + p), c) == here) {
                    found = true, v = arc.to, q = p;
                    break;
                }
            if (found) break;
        }
        if (!found) break;
        out.push_back({v, q});
    }
    throw std::logic_error("the search tree does not lead to the target");
}

Planner::Planner(const Graph& graph, int mode, Drive drive, std::vector<int> targets,
                 std::vector<std::vector<std::uint8_t>> serve, std::vector<std::uint8_t> settled)
    : graph_(&graph),
      mode_(mode),
      drive_(std::move(drive)),
      targets_(std::move(targets)),
      serve_(std::move(serve)),
      settled_(std::move(settled)),
      legs_(targets_.size()),
      now_(drive_.states, 1) {
    // Legs before the last begin where the one before ends, whatever the rule state there.
    std::vector<int> all(drive_.states);
    for (int q = 0; q < drive_.states; ++q) all[q] = q;
    for (std::size_t i = 0; i < targets_.size(); ++i) {
        legs_[i] = std::make_unique<Leg>(graph, mode, drive_, targets_[i]);
        if (i > 0)
            legs_[i]->set_start(graph.nodes[targets_[i - 1]], {{targets_[i - 1], 0, -1}}, all, true);
    }
}

void Planner::start(int leg, Vec at, std::vector<Link> links, std::vector<std::uint8_t> states) {
    for (; current_ < leg; ++current_) legs_[current_].reset();
    now_ = std::move(states);
    std::vector<int> list;
    for (int q = 0; q < drive_.states; ++q)
        if (now_[q]) list.push_back(q);
    if (leg < static_cast<int>(legs_.size()))
        legs_[leg]->set_start(at, std::move(links), list, false);
}

void Planner::changed(const std::vector<int>& edges) {
    for (auto& leg : legs_)
        if (leg) leg->changed(edges);
}

std::pair<Cost, int> Planner::rest(int leg, int q) const {
    const bool last = leg + 1 == static_cast<int>(legs_.size());
    std::pair<Cost, int> least{kUnreachable, -1};
    for (int p = 0; p < drive_.states; ++p) {
        if (!serve_[leg][q * drive_.states + p]) continue;
        const Cost c = last ? (settled_[p] ? 0 : kUnreachable) : legs_[leg + 1]->value(p);
        if (c < least.first) least = {c, p};
    }
    return least;
}

Cost Planner::plan() {
    const int n = static_cast<int>(legs_.size());
    path_.clear();
    for (int leg = n - 1; leg >= current_; --leg) {
        std::vector<Cost> ends(drive_.states);
        for (int q = 0; q < drive_.states; ++q) ends[q] = rest(leg, q).first;
        const Cost least = *std::min_element(ends.begin(), ends.end());
        if (least >= kUnreachable) {
            blocked_ = first_blocked();
            return kUnreachable;
        }
        // Only the differences steer a leg; a common offset would shift all of its keys.
        for (Cost& c : ends)
            if (c < kUnreachable) c -= least;
        legs_[leg]->set_ends(ends);
        legs_[leg]->search();
    }
    return walk();
}

Cost Planner::walk() {
    const int n = static_cast<int>(legs_.size());
    blocked_ = -1;
    if (current_ >= n) return 0;
    int q = -1;
    for (int p = 0; p < drive_.states; ++p)
        if (now_[p] && (q < 0 || legs_[current_]->value(p) < legs_[current_]->value(q))) q = p;
    Cost total = 0;
    for (int leg = current_; leg < n; ++leg) {
        if (q < 0 || legs_[leg]->value(q) >= kUnreachable) {
            blocked_ = first_blocked();
            path_.clear();
            return kUnreachable;
        }
        total += legs_[leg]->value(q);
        for (auto [v, p] : legs_[leg]->path(q)) path_.push_back({leg, v, p}), q = p;
        total -= legs_[leg]->ends()[q];
        q = rest(leg, q).second;
        path_.push_back({leg, -1, q});
    }
    return total;
}

int Planner::first_blocked() const {
    const int n = drive_.states, legs = static_cast<int>(legs_.size());
    const auto& costs = graph_->costs[mode_];
    std::vector<int> open = legs_[current_]->entries();
    for (int leg = current_; leg < legs; ++leg) {
        std::vector<std::uint8_t> seen(static_cast<std::size_t>(graph_->size()) * n, 0);
        for (int s : open) seen[s] = 1;
        while (!open.empty()) {
            const int s = open.back(), v = s / n, q = s % n;
            open.pop_back();
            for (const Arc& arc : graph_->arcs[v]) {
                if (costs[arc.edge] >= kUnreachable) continue;
                for (int p : drive_.next[graph_->label[arc.edge] * n + q]) {
                    const int t = arc.to * n + p;
                    if (!seen[t]) seen[t] = 1, open.push_back(t);
                }
            }
        }
        std::vector<std::uint8_t> served(n, 0);
        for (int q = 0; q < n; ++q)
            for (int p = 0; p < n; ++p)
                if (seen[targets_[leg] * n + q] && serve_[leg][q * n + p] && !served[p])
                    served[p] = 1, open.push_back(targets_[leg] * n + p);
        if (open.empty()) return leg;
    }
    return legs - 1;
}

long Planner::expanded() const {
    long sum = 0;
    for (const auto& leg : legs_)
        if (leg) sum += leg->expanded();
    return sum;
}

}  // namespace oath

void bind_planner(nb::module_& m) {
    using oath::Cost;
    using oath::Planner;
    nb::class_<Planner>(m, "Planner",
                        "Layered D*-Lite over the implicit product of a graph and an automaton.")
        .def(
            "__init__",
            [](Planner* self, const oath::Graph& graph, int mode, Bytes3 drive,
               std::vector<int> targets, Bytes3 serve, Array<std::uint8_t> settled) {
                const std::size_t n = drive.shape(1), cells = n * n;
                if (drive.shape(2) != n || serve.shape(1) != n || serve.shape(2) != n ||
                    settled.shape(0) != n || serve.shape(0) != targets.size() || n == 0)
                    throw std::invalid_argument("the tables disagree in the number of states");
                if (mode < 0 || mode >= static_cast<int>(graph.costs.size()))
                    throw std::out_of_range("no such mode");
                for (int v : targets)
                    if (v < 0 || v >= graph.size()) throw std::out_of_range("no such node");
                for (int l : graph.label)
                    if (l >= static_cast<int>(drive.shape(0)))
                        throw std::invalid_argument("drive needs a table for every label");
                std::vector<std::vector<std::uint8_t>> tables;
                for (std::size_t i = 0; i < targets.size(); ++i)
                    tables.emplace_back(serve.data() + i * cells, serve.data() + (i + 1) * cells);
                new (self) Planner(
                    graph, mode,
                    oath::Drive(static_cast<int>(n), static_cast<int>(drive.shape(0)),
                                drive.data()),
                    std::move(targets), std::move(tables),
                    std::vector<std::uint8_t>(settled.data(), settled.data() + n));
            },
            "graph"_a, "mode"_a, "drive"_a, "targets"_a, "serve"_a, "settled"_a,
            nb::keep_alive<1, 2>(),
            "Plan the legs to the target nodes in order. drive (labels, q, q'), serve (legs, q, q') "
            "and settled (q,) flag how the rule state may move and where it may end.")
        .def(
            "start",
            [](Planner& self, int leg, double x, double y, std::vector<int> nodes,
               std::vector<Cost> costs, std::vector<int> labels,
               std::vector<std::uint8_t> states) {
                if (nodes.size() != costs.size() || nodes.size() != labels.size())
                    throw std::invalid_argument("arrays differ in length");
                if (leg < 0 || leg > self.legs()) throw std::out_of_range("no such leg");
                if (static_cast<int>(states.size()) != self.drive().states)
                    throw std::invalid_argument("states needs a flag for every rule state");
                std::vector<oath::Link> links;
                for (std::size_t i = 0; i < nodes.size(); ++i) {
                    if (nodes[i] < 0 || nodes[i] >= self.graph().size())
                        throw std::out_of_range("no such node");
                    if (labels[i] < -1 || labels[i] >= self.drive().labels)
                        throw std::out_of_range("no such label");
                    links.push_back({nodes[i], costs[i], labels[i]});
                }
                self.start(leg, {x, y}, std::move(links), std::move(states));
            },
            "leg"_a, "x"_a, "y"_a, "nodes"_a, "costs"_a, "labels"_a, "states"_a,
            "The robot is at (x, y) on its way to stop `leg`; it may enter the graph at the nodes "
            "at these costs [um], driving edges of these labels.")
        .def(
            "changed",
            [](Planner& self, std::vector<int> edges) {
                for (int e : edges)
                    if (e < 0 || e >= self.graph().edges()) throw std::out_of_range("no such edge");
                nb::gil_scoped_release release;
                self.changed(edges);
            },
            "edges"_a, "The costs of these edges changed.")
        .def("plan", &Planner::plan, nb::call_guard<nb::gil_scoped_release>(),
             "Repair the plan; return its cost [um], UNREACHABLE if there is none.")
        .def(
            "path",
            [](const Planner& self) {
                std::vector<int> out;
                for (const auto& s : self.path())
                    out.push_back(s.leg), out.push_back(s.node), out.push_back(s.state);
                return array(std::move(out), {self.path().size(), 3});
            },
            "Steps (n, 3) of the last plan: leg, node (-1: the leg's stop is served), rule state.")
        .def_prop_ro("blocked", &Planner::blocked, "The first leg without a way, or -1.")
        .def_prop_ro("expanded", &Planner::expanded, "States expanded so far.");
}
