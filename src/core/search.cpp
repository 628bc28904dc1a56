// Ruin and recreate for pickup and delivery with heterogeneous robots, open routes and capacities.
//
// Source of the moves: Schrimpf et al., "Record breaking optimization results using the ruin and
// recreate principle", 2000; Christiaens and Vanden Berghe, "Slack induction by string removals for
// vehicle routing problems", 2020 (string removal, blinks). The objective adds a makespan term.
#include <nanobind/nanobind.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

#include "arrays.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace oath {

using Length = std::int32_t;  // millimetres
constexpr Length kNoWay = 1 << 28;

// xorshift64*: small, fast, the same on every machine.
struct Random {
    std::uint64_t state;
    explicit Random(std::uint64_t seed) : state(seed * 0x9E3779B97F4A7C15ULL + 0x1234567ULL) {
        if (state == 0) state = 1;
        next(), next();
    }
    std::uint64_t next() {
        state ^= state >> 12, state ^= state << 25, state ^= state >> 27;
        return state * 0x2545F4914F6CDD1DULL;
    }
    int below(int n) { return static_cast<int>(((next() >> 32) * static_cast<std::uint64_t>(n)) >> 32); }
    double unit() { return static_cast<double>(next() >> 11) * (1.0 / 9007199254740992.0); }
};

enum class Kind : std::uint8_t { kDelivery, kVisit, kAboard };

struct Task {
    Kind kind;
    int first, last;  // locations; the same for a visit and for what is aboard already
    int owner;        // the only robot that may serve it, or -1
    double service;   // time at each stop [s]
    std::vector<std::uint8_t> able;  // by robot
};

struct Robot {
    int mode, start, capacity, aboard;
    int most;          // tasks it may be given; what is aboard does not count
    double speed;      // [mm/s]
    double ready;      // when it is free there [s]
};

struct Instance {
    int locations;
    std::vector<std::vector<Length>> cost;  // by mode, (locations, locations)
    std::vector<Task> tasks;
    std::vector<Robot> robots;
    double lambda;

    int size() const { return static_cast<int>(tasks.size()); }
    int fleet() const { return static_cast<int>(robots.size()); }
    // Stop t is the first (or only) stop of task t, stop size() + t the delivery of task t.
    int location(int stop) const { return stop < size() ? tasks[stop].first : tasks[stop - size()].last; }
    int task(int stop) const { return stop < size() ? stop : stop - size(); }
    int load(int stop) const {
        if (stop >= size()) return -1;
        const Kind kind = tasks[stop].kind;
        return kind == Kind::kDelivery ? 1 : kind == Kind::kAboard ? -1 : 0;
    }
};

// A robot's stops with what insertion needs to know at each place.
struct Route {
    std::vector<int> stops;
    std::vector<int> at;       // (n + 1) location before stop i; at[0] is the start
    std::vector<int> load;     // (n + 1) load after i stops
    std::vector<Length> hop;   // (n + 1) cost of hop i; the last is 0: routes are open
    std::int64_t length = 0;   // [mm]
    double service = 0;        // [s]
    int given = 0;             // tasks, without those that were aboard
};

struct Place {
    Length cost = kNoWay;
    int route = -1, first = 0, second = 0;
};

class Search {
public:
    Search(const Instance& instance, std::uint64_t seed) : in_(instance), random_(seed) {
        routes_.resize(in_.fleet());
        owner_.assign(in_.size(), -1);
        out_.assign(in_.size(), 0);
        saved_at_.assign(in_.fleet(), -1);
        for (int r = 0; r < in_.fleet(); ++r) refresh(r);
        find_neighbours();
    }

    void begin(const std::vector<std::vector<int>>& routes) {
        for (int r = 0; r < in_.fleet(); ++r) {
            routes_[r].stops = routes[r];
            for (int stop : routes[r]) owner_[in_.task(stop)] = r;
            refresh(r);
        }
        // What is aboard must be served whatever it costs, so it goes first.
        removed_.clear();
        for (int pass = 0; pass < 2; ++pass)
            for (int t = 0; t < in_.size(); ++t)
                if (owner_[t] < 0 && (in_.tasks[t].kind == Kind::kAboard) == (pass == 0))
                    removed_.push_back(t);
        slowest_ = slowest();
        insert_all(0.0, removed_.size() <= 80);
        forget();
    }

    // Returns the number of iterations; the best routes stay in best().
    long run(double seconds, long iterations) {
        const auto began = std::chrono::steady_clock::now();
        best_ = stops();
        best_value_ = value();
        best_missing_ = missing_;
        if (in_.size() == 0) return 0;
        double current = best_value_;
        int missing = missing_;
        const double scale = std::max(1.0, current / std::max(1, in_.size()));
        const double hot = 0.4 * scale, cold = 0.006 * scale;
        double heat = hot;
        long done = 0;
        for (;; ++done) {
            if ((done & 15) == 0) {
                const std::chrono::duration<double> gone = std::chrono::steady_clock::now() - began;
                const double share = std::max(
                    iterations >= 0 ? static_cast<double>(done) / std::max(1L, iterations) : 0.0,
                    seconds >= 0 ? gone.count() / std::max(seconds, 1e-9) : 0.0);
                if (share >= 1.0) break;
                heat = hot * std::pow(cold / hot, share);
            }
            if (iterations >= 0 && done >= iterations) break;
            ruin();
            slowest_ = in_.lambda > 0 ? slowest() : 0.0;
            insert_all(0.01, random_.unit() < 0.25 && removed_.size() <= 16);
            const double now = value();
            const bool fewer = missing_ < missing, same = missing_ == missing;
            if (fewer || (same && now < current - heat * std::log(std::max(1e-12, random_.unit())))) {
                current = now, missing = missing_;
                if (missing_ < best_missing_ || (missing_ == best_missing_ && now < best_value_ - 1e-6)) {
                    best_ = stops(), best_value_ = now, best_missing_ = missing_;
                }
                forget();
            } else {
                undo();
            }
        }
        return done;
    }

    const std::vector<std::vector<int>>& best() const { return best_; }

private:
    std::vector<std::vector<int>> stops() const {
        std::vector<std::vector<int>> out;
        for (const Route& route : routes_) out.push_back(route.stops);
        return out;
    }

    double time(int r, std::int64_t length, double service) const {
        const Robot& robot = in_.robots[r];
        return robot.ready + static_cast<double>(length) / robot.speed + service;
    }

    double slowest() const {
        double most = 0;
        for (int r = 0; r < in_.fleet(); ++r)
            most = std::max(most, time(r, routes_[r].length, routes_[r].service));
        return most;
    }

    double value() const {
        double sum = 0;
        for (const Route& route : routes_) sum += static_cast<double>(route.length);
        return in_.lambda > 0 ? sum + in_.lambda * 1000.0 * slowest() : sum;
    }

    void refresh(int r) {
        Route& route = routes_[r];
        const Robot& robot = in_.robots[r];
        const auto& cost = in_.cost[robot.mode];
        const std::size_t n = route.stops.size();
        route.at.resize(n + 1), route.load.resize(n + 1), route.hop.resize(n + 1);
        route.at[0] = robot.start, route.load[0] = robot.aboard;
        route.length = 0, route.service = 0, route.given = 0;
        for (std::size_t i = 0; i < n; ++i) {
            const int stop = route.stops[i];
            route.at[i + 1] = in_.location(stop);
            route.load[i + 1] = route.load[i] + in_.load(stop);
            route.hop[i] = cost[static_cast<std::size_t>(route.at[i]) * in_.locations + route.at[i + 1]];
            route.length += route.hop[i];
            route.service += in_.tasks[in_.task(stop)].service;
            route.given += stop < in_.size() && in_.tasks[stop].kind != Kind::kAboard;
        }
        route.hop[n] = 0;
    }

    void find_neighbours() {
        const int n = in_.size(), k = std::min(n - 1, 60);
        near_.assign(n, {});
        if (n < 2) return;
        std::vector<int> order(n);
        std::vector<std::int64_t> apart(n);
        const auto& cost = in_.cost[0];
        for (int t = 0; t < n; ++t) {
            const Length* a = &cost[static_cast<std::size_t>(in_.tasks[t].first) * in_.locations];
            const Length* b = &cost[static_cast<std::size_t>(in_.tasks[t].last) * in_.locations];
            for (int u = 0; u < n; ++u)
                apart[u] = 3LL * a[in_.tasks[u].first] + b[in_.tasks[u].last];
            apart[t] = -1;
            std::iota(order.begin(), order.end(), 0);
            std::partial_sort(order.begin(), order.begin() + k + 1, order.end(), [&](int x, int y) {
                return apart[x] < apart[y] || (apart[x] == apart[y] && x < y);
            });
            near_[t].assign(order.begin() + 1, order.begin() + k + 1);
        }
    }

    // -- undo

    void touch(int r) {
        if (saved_at_[r] >= 0) return;
        saved_at_[r] = static_cast<int>(saved_.size());
        saved_.push_back({r, routes_[r]});
    }
    void forget() {
        for (const auto& [r, route] : saved_) saved_at_[r] = -1;
        saved_.clear();
        missing_before_ = missing_;
    }
    void undo() {
        for (auto& [r, route] : saved_) {
            for (int stop : routes_[r].stops) owner_[in_.task(stop)] = -1;
        }
        for (auto& [r, route] : saved_) {
            std::swap(routes_[r], route);
            for (int stop : routes_[r].stops) owner_[in_.task(stop)] = r;
            saved_at_[r] = -1;
        }
        saved_.clear();
        missing_ = missing_before_;
    }

    // -- ruin

    void take(int t) {
        if (out_[t]) return;
        out_[t] = 1;
        removed_.push_back(t);
    }

    void ruin() {
        removed_.clear();
        const int n = in_.size();
        // What nobody serves yet gets another chance every time.
        for (int t = 0; t < n && missing_ > 0; ++t)
            if (owner_[t] < 0) take(t);
        const int most = std::max(2, std::min({n, 14, static_cast<int>(0.6 * n) + 1}));
        const double choice = random_.unit();
        const int seed = random_.below(n);
        if (choice < 0.04) {
            take_route(seed);
        } else if (choice < 0.6) {
            take_strings(seed);
        } else if (choice < 0.85) {
            take_near(seed, 1 + random_.below(most));
        } else {
            for (int i = 1 + random_.below(most); i > 0; --i) take(random_.below(n));
        }
        for (int t : removed_)
            if (owner_[t] >= 0) touch(owner_[t]);
        for (const auto& [r, before] : saved_) {
            auto& stops = routes_[r].stops;
            stops.erase(std::remove_if(stops.begin(), stops.end(),
                                       [&](int stop) { return out_[in_.task(stop)] != 0; }),
                        stops.end());
            refresh(r);
        }
        for (int t : removed_) {
            owner_[t] = -1;
            out_[t] = 0;
        }
    }

    void take_route(int seed) {
        const int r = owner_[seed];
        if (r < 0 || routes_[r].stops.size() > 40) return take(seed);
        for (int stop : routes_[r].stops) take(in_.task(stop));
    }

    void take_near(int seed, int count) {
        take(seed);
        for (int tries = 0; static_cast<int>(removed_.size()) < count && tries < 50; ++tries) {
            const auto& near = near_[removed_[random_.below(static_cast<int>(removed_.size()))]];
            if (near.empty()) return;
            const double u = random_.unit();
            take(near[static_cast<std::size_t>(u * u * u * static_cast<double>(near.size()))]);
        }
    }

    // Strings of stops out of routes that pass near each other.
    void take_strings(int seed) {
        const std::size_t most = 2 * static_cast<std::size_t>(std::min(10.0, 0.35 * in_.size() + 1));
        const int wanted = 1 + random_.below(std::max(1, std::min(4, in_.fleet())));
        std::vector<int> cut;
        auto cut_at = [&](int t) {
            const int r = owner_[t];
            if (r < 0 || std::find(cut.begin(), cut.end(), r) != cut.end()) return;
            cut.push_back(r);
            const auto& stops = routes_[r].stops;
            const int size = static_cast<int>(stops.size());
            const int length = 1 + random_.below(std::min(16, size));
            const int place = static_cast<int>(
                std::find_if(stops.begin(), stops.end(), [&](int s) { return in_.task(s) == t; }) -
                stops.begin());
            const int low = std::max(0, place - length + 1), high = std::min(place, size - length);
            const int first = low + random_.below(std::max(1, high - low + 1));
            const int skip = random_.unit() < 0.3 && length < size ? random_.below(length) : -1;
            for (int i = first; i < std::min(first + length, size); ++i) {
                if (i - first == skip) continue;
                take(in_.task(stops[i]));
                if (removed_.size() >= most) return;
            }
        };
        cut_at(seed);
        if (cut.empty()) take(seed);
        for (int t : near_[seed]) {
            if (static_cast<int>(cut.size()) >= wanted || removed_.size() >= most) break;
            if (!out_[t]) cut_at(t);
        }
    }

    // -- recreate

    // What an insertion costs, makespan included, if it lengthens route r by `length`.
    Length priced(int r, int t, Length length) const {
        if (in_.lambda <= 0 || length >= kNoWay) return length;
        const Task& task = in_.tasks[t];
        const double service = task.service * (task.kind == Kind::kDelivery ? 2 : 1);
        const double end = time(r, routes_[r].length + length, routes_[r].service + service);
        const double more = in_.lambda * 1000.0 * std::max(0.0, end - slowest_);
        return static_cast<Length>(std::min(static_cast<double>(kNoWay - 1), length + more));
    }

    // The cheapest way to insert task t into route r that adds less than `limit`.
    Place cheapest(int t, int r, Length limit, double blink) {
        const Route& route = routes_[r];
        const Robot& robot = in_.robots[r];
        const Task& task = in_.tasks[t];
        const auto& cost = in_.cost[robot.mode];
        // Costs are symmetric, so a row serves as a column.
        const Length* first = &cost[static_cast<std::size_t>(task.first) * in_.locations];
        const Length* last = &cost[static_cast<std::size_t>(task.last) * in_.locations];
        const int n = static_cast<int>(route.stops.size());
        Place best;
        best.cost = limit;
        if (task.kind != Kind::kAboard && route.given >= robot.most) return best;
        for (int i = 0; i <= n; ++i) {
            // What is aboard takes room up to here.
            if (task.kind == Kind::kAboard && route.load[i] > robot.capacity) break;
            const Length in = first[route.at[i]];
            if (in >= kNoWay || (blink > 0 && random_.unit() < blink)) continue;
            const Length on = i < n ? first[route.at[i + 1]] : 0;
            if (task.kind != Kind::kDelivery) {
                const Length c = in + on - route.hop[i];
                if (c < best.cost && on < kNoWay) best = {c, r, i, i};
                continue;
            }
            if (route.load[i] >= robot.capacity) continue;
            const Length direct = first[task.last], after = i < n ? last[route.at[i + 1]] : 0;
            const Length c = in + direct + after - route.hop[i];
            if (c < best.cost && direct < kNoWay && after < kNoWay) best = {c, r, i, i};
            if (i == n) break;
            // The second stop adds something too, so a detour that is too long already is no use.
            const Length detour = in + on - route.hop[i];
            if (on >= kNoWay || detour >= best.cost) continue;
            for (int j = i + 1; j <= n; ++j) {
                if (route.load[j] >= robot.capacity) break;
                const Length out = last[route.at[j]], next = j < n ? last[route.at[j + 1]] : 0;
                const Length both = detour + out + next - route.hop[j];
                if (both < best.cost && out < kNoWay && next < kNoWay) best = {both, r, i, j};
            }
        }
        return best;
    }

    bool may(int t, int r) const {
        const Task& task = in_.tasks[t];
        return task.owner >= 0 ? task.owner == r : task.able[r] != 0;
    }

    // Routes worth a look for task t: all of a small fleet, else those that its neighbours are in.
    void candidates(int t) {
        candidates_.clear();
        if (in_.fleet() <= 8 || in_.tasks[t].owner >= 0) {
            for (int r = 0; r < in_.fleet(); ++r)
                if (may(t, r)) candidates_.push_back(r);
            return;
        }
        auto add = [&](int r) {
            if (may(t, r) && std::find(candidates_.begin(), candidates_.end(), r) == candidates_.end())
                candidates_.push_back(r);
        };
        for (int u : near_[t]) {
            if (owner_[u] >= 0) add(owner_[u]);
            if (candidates_.size() >= 8) break;
        }
        for (int i = 0; i < 3; ++i) add(random_.below(in_.fleet()));
    }

    Place best_place(int t, double blink) {
        candidates(t);
        Place best;
        auto look = [&](int r, double b) {
            Place place = cheapest(t, r, kNoWay, b);
            if (place.route < 0) return;
            place.cost = priced(r, t, place.cost);
            if (place.cost < best.cost) best = place;
        };
        for (int r : candidates_) look(r, blink);
        if (best.route < 0)
            for (int r = 0; r < in_.fleet(); ++r)
                if (may(t, r)) look(r, 0.0);
        return best;
    }

    void insert(int t, const Place& place) {
        touch(place.route);
        auto& stops = routes_[place.route].stops;
        if (in_.tasks[t].kind == Kind::kDelivery)
            stops.insert(stops.begin() + place.second, in_.size() + t);
        stops.insert(stops.begin() + place.first, t);
        owner_[t] = place.route;
        refresh(place.route);
        if (in_.lambda > 0) {
            const Route& route = routes_[place.route];
            slowest_ = std::max(slowest_, time(place.route, route.length, route.service));
        }
    }

    void insert_all(double blink, bool regret) {
        missing_ = 0;
        if (regret) return insert_by_regret(blink);
        order_removed();
        for (int t : removed_) {
            const Place place = best_place(t, blink);
            if (place.route >= 0) insert(t, place);
            else ++missing_;
        }
    }

    void order_removed() {
        const double choice = random_.unit();
        auto length = [&](int t) {
            const Task& task = in_.tasks[t];
            return in_.cost[0][static_cast<std::size_t>(task.first) * in_.locations + task.last];
        };
        for (std::size_t i = removed_.size(); i > 1; --i)
            std::swap(removed_[i - 1], removed_[random_.below(static_cast<int>(i))]);
        if (choice < 0.2)
            std::stable_sort(removed_.begin(), removed_.end(),
                             [&](int a, int b) { return length(a) > length(b); });
        else if (choice < 0.35)
            std::stable_sort(removed_.begin(), removed_.end(),
                             [&](int a, int b) { return length(a) < length(b); });
        else if (choice < 0.6)
            std::stable_sort(removed_.begin(), removed_.end(), [&](int a, int b) {
                return in_.tasks[a].last < in_.tasks[b].last;
            });
    }

    // Next is always the task that would lose most by waiting: second best minus best.
    void insert_by_regret(double blink) {
        const std::size_t n = removed_.size();
        std::vector<std::vector<Place>> table(n);
        for (std::size_t k = 0; k < n; ++k) {
            candidates(removed_[k]);
            for (int r : candidates_) table[k].push_back(quoted(removed_[k], r, blink));
        }
        std::vector<std::uint8_t> done(n, 0);
        for (std::size_t round = 0; round < n; ++round) {
            std::int64_t most = -1;
            std::size_t chosen = n;
            Place place;
            for (std::size_t k = 0; k < n; ++k) {
                if (done[k]) continue;
                Place first;
                Length second = kNoWay;
                for (const Place& p : table[k]) {
                    if (p.cost < first.cost) second = first.cost, first = p;
                    else second = std::min(second, p.cost);
                }
                const bool aboard = in_.tasks[removed_[k]].kind == Kind::kAboard;
                const std::int64_t regret =
                    first.route < 0 ? 0 : 1LL + second - first.cost + (aboard ? kNoWay : 0);
                if (regret > most) most = regret, chosen = k, place = first;
            }
            const int t = removed_[chosen];
            done[chosen] = 1;
            if (place.route < 0) place = best_place(t, 0.0);
            if (place.route < 0) {
                ++missing_;
                continue;
            }
            insert(t, place);
            for (std::size_t k = 0; k < n; ++k)
                if (!done[k])
                    for (Place& p : table[k])
                        if (p.route == place.route || p.second == -1 - place.route)
                            p = quoted(removed_[k], place.route, blink);
        }
    }

    Place quoted(int t, int r, double blink) {
        Place place = cheapest(t, r, kNoWay, blink);
        if (place.route < 0) {
            place.second = -1 - r;  // remembers the route that had no room
            place.cost = kNoWay;
        } else {
            place.cost = priced(r, t, place.cost);
        }
        return place;
    }

    const Instance& in_;
    Random random_;
    std::vector<Route> routes_;
    std::vector<int> owner_;  // by task, -1 = in no route
    std::vector<std::vector<int>> near_;
    std::vector<int> removed_, candidates_;
    std::vector<std::uint8_t> out_;
    std::vector<std::pair<int, Route>> saved_;
    std::vector<int> saved_at_;
    double slowest_ = 0;
    int missing_ = 0, missing_before_ = 0;
    std::vector<std::vector<int>> best_;
    double best_value_ = std::numeric_limits<double>::infinity();
    int best_missing_ = 0;
};

}  // namespace oath

void bind_search(nb::module_& m) {
    using namespace oath;
    using Matrix3 = nb::ndarray<const double, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
    using Lists = std::vector<std::vector<int>>;
    m.def(
        "search",
        [](Matrix3 cost, Array<int> first, Array<int> last, Array<int> kind, Array<int> owner,
           Array<double> service, Bytes2 able, Array<int> mode, Array<int> start,
           Array<int> capacity, Array<int> aboard, Array<int> most, Array<double> speed,
           Array<double> ready, double makespan_weight, Lists routes, std::uint64_t seed,
           double seconds, long iterations) {
            Instance in;
            in.lambda = makespan_weight;
            in.locations = static_cast<int>(cost.shape(1));
            const std::size_t cells = cost.shape(1) * cost.shape(2);
            const int n = static_cast<int>(first.shape(0)), fleet = static_cast<int>(mode.shape(0));
            if (cost.shape(1) != cost.shape(2) || able.shape(0) != first.shape(0) ||
                (n > 0 && able.shape(1) != mode.shape(0)) ||
                routes.size() != static_cast<std::size_t>(fleet))
                throw std::invalid_argument("the arrays disagree in shape");
            for (std::size_t k = 0; k < cost.shape(0); ++k) {
                in.cost.emplace_back(cells);
                for (std::size_t i = 0; i < cells; ++i) {
                    const double mm = cost.data()[k * cells + i] * 1000.0;
                    in.cost.back()[i] = mm < kNoWay ? static_cast<Length>(std::llround(mm)) : kNoWay;
                }
            }
            auto place = [&](int location) {
                if (location < 0 || location >= in.locations) throw std::out_of_range("no such location");
                return location;
            };
            for (int t = 0; t < n; ++t) {
                const auto* row = able.data() + static_cast<std::size_t>(t) * fleet;
                in.tasks.push_back({static_cast<Kind>(kind.data()[t]), place(first.data()[t]),
                                    place(last.data()[t]), owner.data()[t], service.data()[t],
                                    {row, row + fleet}});
                if (kind.data()[t] < 0 || kind.data()[t] > 2 || owner.data()[t] >= fleet)
                    throw std::out_of_range("no such kind or owner");
            }
            for (int r = 0; r < fleet; ++r) {
                if (mode.data()[r] < 0 || mode.data()[r] >= static_cast<int>(cost.shape(0)))
                    throw std::out_of_range("no such mode");
                in.robots.push_back({mode.data()[r], place(start.data()[r]), capacity.data()[r],
                                     aboard.data()[r], most.data()[r], speed.data()[r] * 1000.0,
                                     ready.data()[r]});
                for (int stop : routes[r])
                    if (stop < 0 || stop >= 2 * n) throw std::out_of_range("no such stop");
            }
            nb::gil_scoped_release release;
            Search search(in, seed);
            search.begin(routes);
            const long done = search.run(seconds, iterations);
            return std::make_tuple(search.best(), done);
        },
        "cost"_a, "first"_a, "last"_a, "kind"_a, "owner"_a, "service"_a, "able"_a, "mode"_a,
        "start"_a, "capacity"_a, "aboard"_a, "most"_a, "speed"_a, "ready"_a,
        "makespan_weight"_a, "routes"_a, "seed"_a, "seconds"_a, "iterations"_a,
        "Ruin and recreate: better routes (lists of stops) and the iterations made. Task t has the "
        "kind 0 = delivery (stops t and n + t), 1 = visit, 2 = aboard (its delivery is stop t). A "
        "robot is given `most` tasks at most, those aboard not counted. "
        "cost (modes, n, n) [m] symmetric; negative seconds or iterations do not limit.");
}
