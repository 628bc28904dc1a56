// Exact assignment and routing for few tasks: heterogeneous, capacitated pickup and delivery with
// open routes, by bounded dynamic programming.
//
// State: (taken set, carried set, place, robot in hand). Robots are filled one after another, and a
// state that took k tasks comes only from states that took at most k, so the search goes layer by
// layer and within a layer from full hands to empty ones. Tasks with one delivery location share a
// *site*: a robot that arrives there hands over all that it carries for it, which costs nothing.
//
// A state is dropped if another one of the same sets, place and robot is at least as good, or if
// its value plus a lower bound of the rest (`Completion`) reaches the upper bound. The bound is a
// spanning tree with penalties: Held and Karp, "The traveling-salesman problem and minimum spanning
// trees", 1970 and 1971. Filling the robots in sequence keeps the state free of who did what.
#include <nanobind/nanobind.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string>

#include "arrays.hpp"

using namespace nb::literals;

namespace {

constexpr int kMaxTasks = 32, kMaxRobots = 1000;
constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kTolerance = 1e-9;  // relative: values this near count as equal
using Set = std::uint32_t;           // of tasks, or of sites

int size(Set set) { return __builtin_popcount(set); }
int lowest(Set set) { return __builtin_ctz(set); }

struct Robot {
    int mode, start, capacity, most;
    double speed;
    std::vector<std::uint8_t> able;  // by task
};

// Places: one per task for its first stop, then one per site.
struct Instance {
    int tasks = 0, sites = 0;
    double weight = 0;  // of the makespan [m/s]
    std::vector<int> site;         // by task; -1 for a visit
    std::vector<double> service;   // by task, at each stop [s]
    std::vector<Robot> robots;
    std::vector<std::vector<double>> leg;    // by mode, (places, places), row = from
    std::vector<std::vector<double>> enter;  // by robot, (places): from its start

    int places() const { return tasks + sites; }
    int fleet() const { return static_cast<int>(robots.size()); }
    bool visit(int task) const { return site[task] < 0; }
    double way(int robot, int from, int to) const {
        return from == places() ? enter[robot][to]
                                : leg[robots[robot].mode][from * places() + to];
    }
    // Whether a robot may ever stand at a place.
    bool stands(int robot, int place) const {
        const auto& able = robots[robot].able;
        if (place < tasks) return able[place];
        for (int t = 0; t < tasks; ++t)
            if (able[t] && site[t] == place - tasks) return true;
        return false;
    }
    double work(int task) const { return service[task] * (visit(task) ? 1 : 2); }
};

// Least spanning tree of nodes that are joined to a root by `key` (Prim). `link(child, parent)` is
// told every edge, parent -1 = the root. Both arrays are used up.
template <class Link>
double spanning_tree(const double* cost, int stride, int* node, double* key, int* parent, int count,
                     Link link) {
    double total = 0;
    for (int a = 0; a < count; ++a) parent[a] = -1;
    while (count > 0) {
        int next = 0;
        for (int a = 1; a < count; ++a)
            if (key[a] < key[next]) next = a;
        const int joined = node[next];
        total += key[next];
        link(joined, parent[next]);
        --count;
        node[next] = node[count], key[next] = key[count], parent[next] = parent[count];
        const double* row = cost + static_cast<std::size_t>(joined) * stride;
        for (int a = 0; a < count; ++a)
            if (row[node[a]] < key[a]) key[a] = row[node[a]], parent[a] = joined;
    }
    return total;
}

// A lower bound of the length that serves what is left.
//
// Whatever is left to visit hangs together with the robot in hand and the starts of those after it,
// so no completion is shorter than a least spanning tree whose edges cost what the cheapest robot
// pays in the cheaper direction. A site that needs v visits is entered v - 1 times beside the tree.
// Every first stop of a delivery has exactly two legs and a visit at most two: with penalties p on
// the legs of stop i, tree(p) - 2 sum p is a bound, too; `ascend` looks for the best ones.
class Completion {
public:
    Completion(const Instance& in, int suffixes) : in_(in), penalty_(in.tasks, 0.0) {
        const std::size_t n = in.places();
        link_.assign(suffixes, std::vector<double>(n * n, kInf));
        start_.assign(suffixes + 1, std::vector<double>(n, kInf));
        room_.assign(suffixes, 1);
        for (int r = in.fleet() - 1; r >= 0; --r) add_robot(r, std::min(r, suffixes - 1));
        bare_link_ = link_, bare_start_ = start_;
        limit_penalties();
    }

    // Least length of all; the best penalties stay.
    double ascend(double upper, int rounds) {
        std::vector<double> best = penalty_;
        double most = -kInf, factor = 1.5;
        int since = 0;
        std::vector<int> degree(in_.places());
        for (int round = 0; round < rounds; ++round) {
            const double bound = whole(degree);
            if (!(bound < kInf)) return kInf;
            if (bound > most) most = bound, best = penalty_, since = 0;
            else if (++since >= 12) factor *= 0.7, since = 0, penalty_ = best;
            double norm = 0;
            for (int t = 0; t < in_.tasks; ++t) norm += (degree[t] - 2.0) * (degree[t] - 2.0);
            if (norm == 0 || factor < 1e-4) break;
            const double goal = upper < kInf ? upper : 1.2 * most + 1e-9;
            const double step = factor * std::max(1e-3 * goal, goal - bound) / norm;
            for (int t = 0; t < in_.tasks; ++t)
                penalty_[t] = std::max(least_[t], penalty_[t] + step * (degree[t] - 2));
            apply(1);
        }
        penalty_ = best;
        apply(link_.size());
        return std::max(0.0, most);
    }

    // Of a state with the first stops `open` and the sites of `carried` left; see Search.
    double rest(Set open, Set carried, const Set* site_tasks, int place, int robot,
                bool may_take) const {
        const int n = in_.places();
        int node[2 * kMaxTasks], parent[2 * kMaxTasks], count = 0;
        double key[2 * kMaxTasks], total = 0;
        const auto& robot_in_hand = in_.robots[robot];
        const bool room = size(carried) < robot_in_hand.capacity;
        const double* way = place == n ? in_.enter[robot].data()
                                       : &in_.leg[robot_in_hand.mode][place * n];
        const std::vector<double>& later = start_[robot + 1];
        for (Set bits = open; bits; bits &= bits - 1) {
            const int t = lowest(bits);
            double least = later[t];
            if (may_take && robot_in_hand.able[t] && (room || in_.visit(t)))
                least = std::min(least, way[t] + penalty_[t]);
            node[count] = t, key[count++] = least;
            total -= 2 * penalty_[t];
        }
        for (int w = 0; w < in_.sites; ++w) {
            const Set due = (open | carried) & site_tasks[w];
            if (!due) continue;
            node[count] = in_.tasks + w;
            key[count++] = carried & site_tasks[w] ? way[in_.tasks + w] : kInf;
        }
        const double* link = link_[robot].data();
        for (int a = size(open); a < count; ++a) {
            const int visits = (size((open | carried) & site_tasks[node[a] - in_.tasks]) - 1) /
                               room_[robot];
            if (visits > 0) total += visits * cheapest(link + node[a] * n, node, count).second;
        }
        return total + spanning_tree(link, n, node, key, parent, count, [](int, int) {});
    }

private:
    void add_robot(int r, int into) {
        const int n = in_.places();
        const Robot& robot = in_.robots[r];
        std::vector<std::uint8_t> stands(n);
        for (int a = 0; a < n; ++a) stands[a] = in_.stands(r, a);
        for (int suffix = 0; suffix <= into; ++suffix) {
            for (int a = 0; a < n; ++a)
                for (int b = 0; b < n; ++b) {
                    if (a == b || !stands[a] || !stands[b]) continue;
                    const auto& leg = in_.leg[robot.mode];
                    double& link = link_[suffix][a * n + b];
                    link = std::min({link, leg[a * n + b], leg[b * n + a]});
                }
            for (int t = 0; t < in_.tasks; ++t)
                if (robot.able[t]) start_[suffix][t] = std::min(start_[suffix][t], in_.enter[r][t]);
            room_[suffix] = std::max(room_[suffix], robot.capacity);
        }
    }

    // A visit may be an end, so its legs may only be made dearer. No leg into a site may become
    // negative: there can be more of them than the bound counts.
    void limit_penalties() {
        least_.assign(in_.tasks, 0.0);
        for (int t = 0; t < in_.tasks; ++t) {
            if (in_.visit(t)) continue;
            double least = kInf;
            for (int w = 0; w < in_.sites; ++w)
                least = std::min(least, bare_link_[0][t * in_.places() + in_.tasks + w]);
            least_[t] = std::isfinite(least) ? -least : 0.0;
        }
    }

    void apply(std::size_t suffixes) {
        const int n = in_.places();
        for (std::size_t s = 0; s < suffixes; ++s)
            for (int a = 0; a < n; ++a)
                for (int b = 0; b < n; ++b)
                    link_[s][a * n + b] = bare_link_[s][a * n + b] + penalty(a) + penalty(b);
        for (std::size_t s = 0; s <= suffixes; ++s)
            for (int t = 0; t < in_.tasks; ++t) start_[s][t] = bare_start_[s][t] + penalty_[t];
    }
    double penalty(int place) const { return place < in_.tasks ? penalty_[place] : 0.0; }

    static std::pair<int, double> cheapest(const double* row, const int* node, int count) {
        std::pair<int, double> least{-1, kInf};
        for (int a = 0; a < count; ++a)
            if (row[node[a]] < least.second) least = {node[a], row[node[a]]};
        return least;
    }

    // The bound for all tasks and robots, and the legs that it uses at each place.
    double whole(std::vector<int>& degree) const {
        const int n = in_.places();
        std::vector<int> node(n), parent(n), due(in_.sites, 0);
        std::vector<double> key(start_[0]);
        std::iota(node.begin(), node.end(), 0);
        std::fill(degree.begin(), degree.end(), 0);
        double total = 0;
        for (int t = 0; t < in_.tasks; ++t) {
            total -= 2 * penalty_[t];
            if (!in_.visit(t)) ++due[in_.site[t]];
        }
        for (int w = 0; w < in_.sites; ++w) {
            const int visits = (due[w] - 1) / room_[0];
            if (visits == 0) continue;
            const double* row = &link_[0][static_cast<std::size_t>(in_.tasks + w) * n];
            const auto [from, cost] = cheapest(row, node.data(), n);
            total += visits * cost;
            if (from >= 0) degree[from] += visits;
        }
        return total + spanning_tree(link_[0].data(), n, node.data(), key.data(), parent.data(), n,
                                     [&](int child, int before) {
                                         ++degree[child];
                                         if (before >= 0) ++degree[before];
                                     });
    }

    const Instance& in_;
    std::vector<double> penalty_, least_;           // by task
    std::vector<std::vector<double>> link_, start_;  // by first robot that counts; penalised
    std::vector<std::vector<double>> bare_link_, bare_start_;
    std::vector<int> room_;  // greatest capacity
};

// What tells one state from another, and how many tasks the robot in hand took, which does not.
struct State {
    Set taken = 0, carried = 0;
    std::uint16_t place = 0, robot = 0, count = 0;

    State() = default;
    State(Set taken_set, Set carried_set, int at, int robot_in_hand, int tasks)
        : taken(taken_set), carried(carried_set), place(static_cast<std::uint16_t>(at)),
          robot(static_cast<std::uint16_t>(robot_in_hand)),
          count(static_cast<std::uint16_t>(tasks)) {}
    bool same(const State& other) const {
        return taken == other.taken && carried == other.carried && place == other.place &&
               robot == other.robot;
    }
    std::size_t hash() const {
        std::uint64_t x = taken | static_cast<std::uint64_t>(carried) << 32;
        x ^= x >> 31, x *= 0x9E3779B97F4A7C15ULL;
        x += place | static_cast<std::uint64_t>(robot) << 16;
        x ^= x >> 29, x *= 0xBF58476D1CE4E5B9ULL;
        return x ^ x >> 32;
    }
};

// A state and what it has cost, without and with the makespan.
struct Length {
    State state;
    double sum = kInf;  // [m]

    bool beats(const Length& other, double) const {
        return sum <= other.sum && state.count <= other.state.count;
    }
    double value(double) const { return sum; }
    void travel(double way, double, double) { sum += way; }
    void close() {}
    bool same(const Length& other) const { return sum == other.sum; }
};

struct Timed {
    State state;
    double sum = kInf;
    double time = 0;    // of the robot in hand [s]
    double latest = 0;  // end of the robots before [s]

    // Whatever follows, the makespan of this one is later by at most the difference taken here.
    bool beats(const Timed& other, double weight) const {
        if (state.count > other.state.count) return false;
        const double later = std::max({0.0, time - other.time,
                                       latest - std::max(other.latest, other.time)});
        return sum + weight * later <= other.sum;
    }
    double value(double weight) const { return sum + weight * std::max(time, latest); }
    void travel(double way, double speed, double service) {
        sum += way, time += way / speed + service;
    }
    void close() { latest = std::max(latest, time), time = 0; }
    bool same(const Timed& other) const {
        return sum == other.sum && time == other.time && latest == other.latest;
    }
};

// Open addressing. Several entries of one state may stand side by side, none of which beats
// another; an infinite sum marks what was beaten later and must still be stepped over.
template <class Entry>
class Table {
public:
    // Enter `entry` unless an equal or better one stands here or it is new and not worth it.
    template <class Worth>
    void offer(const Entry& entry, double weight, Worth worth) {
        if (10 * (used_ + 1) > 7 * slots_.size()) grow();
        bool placed = false;
        std::size_t at = entry.state.hash() & (slots_.size() - 1);
        for (; full_[at]; at = (at + 1) & (slots_.size() - 1)) {
            Entry& slot = slots_[at];
            if (!slot.state.same(entry.state)) continue;
            if (!placed && slot.beats(entry, weight)) return;
            if (!entry.beats(slot, weight)) continue;
            if (placed) slot.sum = kInf;
            else slot = entry, placed = true;
        }
        if (placed || !worth()) return;
        slots_[at] = entry, full_[at] = 1, ++used_;
    }
    std::size_t used() const { return used_; }

    // Move the entries out.
    std::vector<Entry> drain() {
        std::vector<Entry> out;
        for (std::size_t at = 0; at < slots_.size(); ++at)
            if (full_[at] && slots_[at].sum < kInf) out.push_back(slots_[at]);
        std::vector<Entry>().swap(slots_);
        std::vector<std::uint8_t>().swap(full_);
        used_ = 0;
        return out;
    }

private:
    void grow() {
        const std::size_t size = std::max<std::size_t>(64, 2 * slots_.size());
        const std::vector<Entry> entries = drain();
        slots_.resize(size), full_.resize(size);
        for (const Entry& entry : entries) {
            std::size_t at = entry.state.hash() & (size - 1);
            while (full_[at]) at = (at + 1) & (size - 1);
            slots_[at] = entry, full_[at] = 1, ++used_;
        }
    }
    std::vector<Entry> slots_;
    std::vector<std::uint8_t> full_;
    std::size_t used_ = 0;
};

struct Limits {
    std::chrono::steady_clock::time_point deadline;
    std::size_t states;
};

struct Answer {
    std::vector<std::vector<int>> routes;  // empty if there is none below the upper bound
    double value = kInf, lower = 0;
    bool complete = false;  // nothing was left out
    std::size_t states = 0;
};

// Let the interpreter see Ctrl-C.
void check_signals() {
    nb::gil_scoped_acquire acquire;
    if (PyErr_CheckSignals() != 0) throw nb::python_error();
}

template <class Entry>
class Search {
public:
    Search(const Instance& in, int skip, double upper, double least_makespan,
           const Completion& completion, Limits limits)
        : in_(in), completion_(completion), limits_(limits), skip_(skip), goal_(in.tasks - skip),
          upper_(upper), least_makespan_(least_makespan) {
        all_ = static_cast<Set>((1ULL << in.tasks) - 1);
        site_tasks_.assign(in.sites, 0);
        for (int t = 0; t < in.tasks; ++t)
            if (!in.visit(t)) site_tasks_[in.site[t]] |= 1u << t;
        const int fleet = in.fleet();
        able_.assign(fleet, 0), later_.assign(fleet + 1, 0), room_later_.assign(fleet + 1, 0);
        speed_later_.assign(fleet + 1, 0.0);
        for (int r = fleet - 1; r >= 0; --r) {
            const Robot& robot = in.robots[r];
            for (int t = 0; t < in.tasks; ++t) able_[r] |= static_cast<Set>(robot.able[t]) << t;
            later_[r] = later_[r + 1] | able_[r];
            room_later_[r] = std::min(in.tasks, room_later_[r + 1] + robot.most);
            speed_later_[r] = speed_later_[r + 1] + robot.speed;
            hands_ = std::max(hands_, robot.capacity);
            counted_ = counted_ || robot.most < in.tasks;
            slowest_ = r == fleet - 1 ? robot.speed : std::min(slowest_, robot.speed);
        }
        cheap_entries();
    }

    Answer run() {
        const int buckets = hands_ + in_.fleet();
        now_.resize(buckets), next_.resize(buckets);
        Entry first;
        first.sum = 0;
        offer({0, 0, in_.places(), 0, 0}, first);
        Answer answer;
        answer.complete = true;
        for (layer_ = 0; layer_ <= goal_ && answer.complete; ++layer_) {
            for (int b = 0; b < buckets && answer.complete; ++b) {
                done_.push_back(now_[b].drain());
                answer.complete = expand_all(done_.back());
            }
            if (answer.complete) now_.swap(next_);
        }
        answer.states = states();
        if (!(best_.sum < kInf)) return answer;
        answer.value = best_.value(in_.weight);
        answer.routes = trace();
        return answer;
    }

private:
    // From full hands to empty ones, and among those from the first robot to the last.
    int bucket(const State& s) const {
        return s.carried ? hands_ - size(s.carried) : hands_ + s.robot;
    }

    std::size_t states() const {
        std::size_t total = 0;
        for (const auto& entries : done_) total += entries.size();
        for (const auto& table : now_) total += table.used();
        for (const auto& table : next_) total += table.used();
        return total;
    }

    bool expand_all(const std::vector<Entry>& entries) {
        for (const Entry& entry : entries) {
            if ((++steps_ & 0xFFF) == 0 && out_of_limits()) return false;
            expand(entry);
        }
        return true;
    }

    bool out_of_limits() const {
        if ((steps_ & 0x3FFFF) == 0) check_signals();
        return std::chrono::steady_clock::now() > limits_.deadline || states() > limits_.states;
    }

    void expand(const Entry& entry) {
        const State s = entry.state;
        const Robot& robot = in_.robots[s.robot];
        if (!s.carried) {
            const int next = after(s);
            if (next < in_.fleet()) offer({s.taken, 0, in_.places(), next, 0}, closed(entry));
        }
        for (int w = 0; w < in_.sites; ++w)
            if (const Set load = s.carried & site_tasks_[w])
                offer(drop(s, w), dropped(entry, s, w, load));
        if (s.count >= robot.most) return;
        const bool full = size(s.carried) >= robot.capacity;
        for (Set bits = all_ & ~s.taken & able_[s.robot]; bits; bits &= bits - 1) {
            const int t = lowest(bits);
            if (!full || in_.visit(t)) offer(take(s, t), taken(entry, s, t));
        }
    }

    // -- transitions: the state after, and what it costs

    // An idle robot's twins stay idle, too.
    int after(const State& s) const {
        int next = s.robot + 1;
        if (s.place != in_.places()) return next;
        while (next < in_.fleet() && twins(in_.robots[s.robot], in_.robots[next])) ++next;
        return next;
    }
    static bool twins(const Robot& a, const Robot& b) {
        return a.mode == b.mode && a.start == b.start && a.capacity == b.capacity &&
               a.most == b.most && a.speed == b.speed && a.able == b.able;
    }
    static Entry closed(Entry entry) {
        entry.close();
        return entry;
    }
    State drop(const State& s, int w) const {
        return {s.taken, s.carried & ~site_tasks_[w], in_.tasks + w, s.robot, s.count};
    }
    Entry dropped(Entry entry, const State& s, int w, Set load) const {
        double service = 0;
        for (; load; load &= load - 1) service += in_.service[lowest(load)];
        entry.travel(in_.way(s.robot, s.place, in_.tasks + w), in_.robots[s.robot].speed, service);
        return entry;
    }
    State take(const State& s, int t) const {
        const Set bit = 1u << t;
        return {s.taken | bit, in_.visit(t) ? s.carried : s.carried | bit, t, s.robot,
                counted_ ? s.count + 1 : 0};
    }
    Entry taken(Entry entry, const State& s, int t) const {
        entry.travel(in_.way(s.robot, s.place, t), in_.robots[s.robot].speed, in_.service[t]);
        return entry;
    }

    // -- entering states

    void offer(const State& s, Entry entry) {
        entry.state = s;
        if (!(entry.value(in_.weight) < upper_ - margin())) return;
        const int missing = goal_ - size(s.taken);
        if (missing == 0 && !s.carried) {
            upper_ = entry.value(in_.weight), best_ = entry;
            return;
        }
        const Set open = all_ & ~s.taken;
        if (size(open & later_[s.robot]) < missing) return;
        if (missing > room_later_[s.robot + 1] + in_.robots[s.robot].most - s.count) return;
        auto& tables = size(s.taken) == layer_ ? now_ : next_;
        tables[bucket(s)].offer(entry, in_.weight,
                                [&] { return bound(entry) < upper_ - margin(); });
    }
    double margin() const { return upper_ < kInf ? kTolerance * std::max(1.0, upper_) : 0.0; }

    // Least objective of all that comes from this entry.
    double bound(const Entry& entry) const {
        const State& s = entry.state;
        const double rest = skip_ ? cheap_rest(s) : tree_rest(s);
        if constexpr (std::is_same_v<Entry, Length>) return entry.sum + rest;
        else return entry.sum + rest + in_.weight * makespan(s, entry, rest);
    }
    double tree_rest(const State& s) const {
        const Set open = all_ & ~s.taken;
        return std::max(0.0, completion_.rest(open, s.carried, site_tasks_.data(), s.place, s.robot,
                                              s.count < in_.robots[s.robot].most));
    }

    // Robots that are not done share what is left, at best evenly.
    template <class T>
    double makespan(const State& s, const T& entry, double rest) const {
        double service = 0;
        if (!skip_)
            for (Set bits = all_ & ~s.taken; bits; bits &= bits - 1)
                service += in_.work(lowest(bits));
        for (Set bits = s.carried; bits; bits &= bits - 1) service += in_.service[lowest(bits)];
        const double shared = entry.time * in_.robots[s.robot].speed + rest + slowest_ * service;
        return std::max(
            {entry.time, entry.latest, least_makespan_, shared / speed_later_[s.robot]});
    }

    // Where some tasks are left out a tree says nothing: each stop is entered by its cheapest leg.
    void cheap_entries() {
        const int n = in_.places();
        cheap_.assign(n, kInf);
        for (int r = 0; r < in_.fleet(); ++r)
            for (int b = 0; b < n; ++b) {
                cheap_[b] = std::min(cheap_[b], in_.enter[r][b]);
                for (int a = 0; a < n; ++a)
                    if (a != b) cheap_[b] = std::min(cheap_[b], in_.way(r, a, b));
            }
        order_.resize(in_.tasks);
        std::iota(order_.begin(), order_.end(), 0);
        std::stable_sort(order_.begin(), order_.end(),
                         [&](int a, int b) { return cheap_[a] < cheap_[b]; });
    }
    double cheap_rest(const State& s) const {
        double total = 0;
        int missing = goal_ - size(s.taken);
        for (int i = 0; i < in_.tasks && missing > 0; ++i)
            if (!(s.taken >> order_[i] & 1u)) total += cheap_[order_[i]], --missing;
        for (int w = 0; w < in_.sites; ++w)
            if (s.carried & site_tasks_[w]) total += cheap_[in_.tasks + w];
        return total;
    }

    // -- the way back: the state before is the one whose transition gives exactly this entry

    std::vector<std::vector<int>> trace() const {
        std::vector<std::vector<int>> routes(in_.fleet());
        Entry entry = best_;
        // Every transition leads to a later bucket.
        for (std::size_t b = done_.size(); b-- > 0;)
            for (const Entry& before : done_[b]) {
                if (!leads(before, entry, routes)) continue;
                entry = before;
                break;
            }
        for (auto& route : routes) std::reverse(route.begin(), route.end());
        return routes;
    }

    // Whether a transition leads from one entry to the other; if so write its stops down.
    bool leads(const Entry& from, const Entry& to, std::vector<std::vector<int>>& routes) const {
        const State &a = from.state, &b = to.state;
        const auto gives = [&](const State& s, const Entry& entry) {
            return s.same(b) && s.count == b.count && entry.same(to);
        };
        if (a.robot != b.robot)
            return a.taken == b.taken && !a.carried && b.place == in_.places() &&
                   after(a) == b.robot &&
                   gives({a.taken, 0, in_.places(), b.robot, 0}, closed(from));
        auto& route = routes[b.robot];
        if (b.place < in_.tasks) {
            const int t = b.place;
            if ((a.taken | 1u << t) != b.taken || a.taken == b.taken) return false;
            if (!gives(take(a, t), taken(from, a, t))) return false;
            route.push_back(t);
            return true;
        }
        const int w = b.place - in_.tasks;
        if (w >= in_.sites || a.taken != b.taken) return false;
        Set load = a.carried & site_tasks_[w];
        if (!load || !gives(drop(a, w), dropped(from, a, w, load))) return false;
        for (; load; load &= load - 1) route.push_back(in_.tasks + lowest(load));
        return true;
    }

    const Instance& in_;
    const Completion& completion_;
    const Limits limits_;
    int skip_, goal_, hands_ = 0, layer_ = 0;
    double upper_, least_makespan_, slowest_ = 0;
    bool counted_ = false;
    Set all_ = 0;
    std::vector<Set> site_tasks_, able_, later_;
    std::vector<int> room_later_, order_;
    std::vector<double> speed_later_, cheap_;
    std::vector<Table<Entry>> now_, next_;
    std::vector<std::vector<Entry>> done_;  // by layer and bucket, for the way back
    Entry best_;
    std::uint64_t steps_ = 0;
};

// No robot ends before it has served the task that takes the longest.
double least_makespan(const Instance& in) {
    double most = 0;
    for (int t = 0; t < in.tasks; ++t) {
        double least = kInf;
        for (int r = 0; r < in.fleet(); ++r) {
            if (!in.robots[r].able[t]) continue;
            const double on = in.visit(t) ? 0.0 : in.way(r, t, in.tasks + in.site[t]);
            least = std::min(least, (in.enter[r][t] + on) / in.robots[r].speed + in.work(t));
        }
        if (std::isfinite(least)) most = std::max(most, least);
    }
    return most;
}

// Look for something below a bound that rises from the least objective there can be: a search is
// short where the bound is tight, and one that finds nothing raises the least objective.
template <class Entry>
Answer search(const Instance& in, int skip, double lower, double upper, double first_gap,
              double least_makespan, const Completion& completion, Limits limits) {
    Answer answer;
    for (double gap = first_gap;; gap *= 2) {
        const double bound = std::min(upper, lower + gap);
        Search<Entry> search(in, skip, bound, least_makespan, completion, limits);
        Answer found = search.run();
        found.states = std::max(found.states, answer.states);
        found.lower = found.complete ? std::min(found.value, bound) : answer.lower;
        answer = std::move(found);
        answer.lower = std::max(answer.lower, lower);
        if (!answer.complete || !answer.routes.empty() || !(bound < upper)) return answer;
    }
}

// More than any objective.
double ceiling(const Instance& in) {
    double longest = 0, slowest = kInf, work = 0;
    const auto look = [&](const std::vector<double>& legs) {
        for (const double leg : legs)
            if (std::isfinite(leg)) longest = std::max(longest, leg);
    };
    for (const auto& legs : in.leg) look(legs);
    for (const auto& legs : in.enter) look(legs);
    for (const Robot& robot : in.robots) slowest = std::min(slowest, robot.speed);
    for (int t = 0; t < in.tasks; ++t) work += in.work(t);
    const double sum = 2.0 * in.tasks * longest;
    return 1.0 + 1.01 * (sum + in.weight * (sum / slowest + work));
}

Answer solve(const Instance& in, int skip, double upper, Limits limits) {
    const bool small = in.tasks <= kMaxTasks && in.fleet() <= kMaxRobots;
    Completion completion(in, small ? in.fleet() : 1);
    const double n = in.places();
    const int rounds = static_cast<int>(std::clamp(4e8 / (n * n + 1), 30.0, 2000.0));
    const double length = skip ? 0.0 : completion.ascend(upper, rounds);
    double speeds = 0, work = 0, slowest = kInf;
    for (const Robot& robot : in.robots)
        speeds += robot.speed, slowest = std::min(slowest, robot.speed);
    for (int t = 0; t < in.tasks; ++t) work += in.work(t);
    const double soonest =
        skip ? 0.0 : std::max(least_makespan(in), (length + slowest * work) / speeds);
    const double lower = in.weight > 0 ? length + in.weight * soonest : length;
    Answer answer;
    answer.lower = std::min(lower, upper);
    answer.complete = !(lower < upper);
    if (!small || answer.complete) return answer;
    const double top = ceiling(in), bound = std::min(upper, top), gap = 2e-3 * lower + 1e-5 * top;
    answer = in.weight > 0
                 ? search<Timed>(in, skip, lower, bound, gap, soonest, completion, limits)
                 : search<Length>(in, skip, lower, bound, gap, soonest, completion, limits);
    if (answer.complete && answer.routes.empty()) answer.lower = upper;
    return answer;
}

using Costs = nb::ndarray<const double, nb::ndim<3>, nb::c_contig, nb::device::cpu>;

int within(int value, std::size_t limit, const char* what) {
    if (value < 0 || static_cast<std::size_t>(value) >= limit)
        throw std::invalid_argument(std::string("no such ") + what);
    return value;
}

Instance make_instance(const Costs& cost, const Array<int>& first, const Array<int>& last,
                       const Array<std::uint8_t>& visit, const Array<double>& service,
                       const Bytes2& able, const Array<int>& mode, const Array<int>& start,
                       const Array<int>& capacity, const Array<int>& most,
                       const Array<double>& speed, double weight) {
    const std::size_t locations = cost.shape(1);
    if (cost.shape(2) != locations) throw std::invalid_argument("cost must be square");
    same_length(first, last), same_length(first, visit), same_length(first, service);
    same_length(mode, start), same_length(mode, capacity), same_length(mode, most);
    same_length(mode, speed);
    Instance in;
    in.tasks = static_cast<int>(first.shape(0)), in.weight = weight;
    if (able.shape(0) != first.shape(0) || (in.tasks > 0 && able.shape(1) != mode.shape(0)))
        throw std::invalid_argument("able must have a row per task and a column per robot");
    std::vector<int> at(in.tasks), sites;
    for (int t = 0; t < in.tasks; ++t) {
        at[t] = within(first.data()[t], locations, "location");
        in.service.push_back(service.data()[t]);
        in.site.push_back(-1);
        if (visit.data()[t]) continue;
        const int there = within(last.data()[t], locations, "location");
        const auto found = std::find(sites.begin(), sites.end(), there);
        in.site[t] = static_cast<int>(found - sites.begin());
        if (found == sites.end()) sites.push_back(there);
    }
    in.sites = static_cast<int>(sites.size());
    at.insert(at.end(), sites.begin(), sites.end());
    const auto row = [&](std::size_t m, int from) {
        std::vector<double> out;
        for (const int to : at) {
            const double value = cost.data()[(m * locations + from) * locations + to];
            if (!(value >= 0)) throw std::invalid_argument("cost has a negative or NaN entry");
            out.push_back(value);
        }
        return out;
    };
    for (std::size_t m = 0; m < cost.shape(0); ++m) {
        in.leg.emplace_back();
        for (const int from : at) {
            const auto values = row(m, from);
            in.leg.back().insert(in.leg.back().end(), values.begin(), values.end());
        }
    }
    for (std::size_t r = 0; r < mode.shape(0); ++r) {
        Robot robot;
        robot.mode = within(mode.data()[r], cost.shape(0), "mode");
        robot.start = within(start.data()[r], locations, "location");
        robot.capacity = std::clamp(capacity.data()[r], 0, in.tasks);
        robot.most = std::clamp(most.data()[r], 0, in.tasks);
        robot.speed = speed.data()[r];
        if (!(robot.speed > 0)) throw std::invalid_argument("a speed is not positive");
        for (int t = 0; t < in.tasks; ++t) robot.able.push_back(able(t, r));
        in.enter.push_back(row(robot.mode, robot.start));
        in.robots.push_back(std::move(robot));
    }
    return in;
}

std::tuple<std::vector<std::vector<int>>, double, double, bool, std::size_t> solve_exact(
    const Costs& cost, const Array<int>& first, const Array<int>& last,
                      const Array<std::uint8_t>& visit, const Array<double>& service,
                      const Bytes2& able, const Array<int>& mode, const Array<int>& start,
                      const Array<int>& capacity, const Array<int>& most,
                      const Array<double>& speed, double makespan_weight, int skip, double upper,
                      double seconds, std::size_t states) {
    const Instance in = make_instance(cost, first, last, visit, service, able, mode, start,
                                      capacity, most, speed, makespan_weight);
    if (skip < 0 || skip > in.tasks) throw std::invalid_argument("skip is not within the tasks");
    Answer answer;
    if (in.fleet() > 0) {
        nb::gil_scoped_release release;
        const auto limit = std::chrono::duration_cast<std::chrono::steady_clock::duration>(
            std::chrono::duration<double>(std::clamp(seconds, 0.0, 1e8)));
        answer = solve(in, skip, upper, {std::chrono::steady_clock::now() + limit, states});
    }
    return {answer.routes, answer.value, answer.lower, answer.complete, answer.states};
}

}  // namespace

void bind_exact(nb::module_& m) {
    m.def("solve_exact", &solve_exact, "cost"_a, "first"_a, "last"_a, "visit"_a, "service"_a,
          "able"_a, "mode"_a, "start"_a, "capacity"_a, "most"_a, "speed"_a, "makespan_weight"_a,
          "skip"_a, "upper"_a, "seconds"_a, "states"_a,
          R"(Least sum of lengths + makespan_weight * makespan, by bounded dynamic programming.

Parameters
----------
cost
    (M, L, L) travel cost [m] per mode, row = from; inf = unreachable.
first, last, visit, service
    (n,) locations of the tasks' stops; 1 = has only the first and loads nothing; time at each [s].
able
    (n, R) which robot may serve which task.
mode, start, capacity, most, speed
    (R,) cost matrix, location, tasks carried at once, tasks in all, [m/s]. Robots are filled in
    this order: the answer does not depend on it, the time does.
makespan_weight
    [m/s].
skip
    Serve exactly n - skip tasks.
upper
    Only objectives below this one [m] are looked for; inf if none is known.
seconds, states
    Limits of time and memory (24 bytes a state, 40 with a makespan; tables take up to twice that
    again).

Returns
-------
routes
    Per robot its stops: t is task t's first, n + t its last. Empty if there is nothing below
    `upper`, or nothing was found within the limits.
value
    Their objective [m]; inf without routes.
lower
    No objective is below this one [m]; at most `upper`.
complete
    Whether the search ended before its limits: `value`, or else `upper`, is then the optimum. Above
    32 tasks or 1000 robots there is only `lower`.
states
    States kept.

Raises
------
ValueError
    A location or mode outside of `cost`, a negative or NaN cost, shapes that disagree.)");
}
