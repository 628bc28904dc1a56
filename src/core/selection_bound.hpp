// Selection: an instance, and what the rest of a route costs at least.
//
// Lower bounds come from a relaxed state space (Christofides, Mingozzi, Toth, "State-space relaxation
// procedures for the computation of bounds to routing problems", 1981): of the sets, only how many
// stops are still to be made is kept, so a route may make one stop twice. Every stop has a price that
// the route gets back when it makes it, and that the bound charges once for each stop that is due;
// subgradient steps set the prices such that relaxed routes make each stop about once.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <vector>

namespace oath::selection {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr int kPricing = 30;  // subgradient steps

// By hand: without a flag for newer processors, compilers call a library function.
inline int count(std::uint32_t bits) {
    bits -= bits >> 1 & 0x55555555u;
    bits = (bits & 0x33333333u) + (bits >> 2 & 0x33333333u);
    return static_cast<int>(((bits + (bits >> 4)) & 0x0F0F0F0Fu) * 0x01010101u >> 24);
}

// The instance on its own dense locations: stop s < n is task s's first, s >= n task s - n's last.
struct Instance {
    int n = 0, take = 0, capacity = 0;
    std::uint32_t visits = 0;
    std::vector<double> from_start;  // (n,) to each first stop
    std::vector<double> leg;         // (2n, 2n), row = to, column = from: a row serves one minimum
    std::vector<double> price;       // (2n,) of each stop; 0 for the last stop of a visit
    std::vector<int> by_price;       // (n,) tasks by the sum of both

    int stops() const { return 2 * n; }
    double to(int stop, int from) const {
        return leg[static_cast<std::size_t>(stop) * stops() + from];
    }
    double task_price(int task) const { return price[task] + price[n + task]; }
    bool visit(int task) const { return visits >> task & 1u; }

    void sort_by_price() {
        std::iota(by_price.begin(), by_price.end(), 0);
        std::stable_sort(by_price.begin(), by_price.end(),
                         [&](int a, int b) { return task_price(a) < task_price(b); });
    }
};

// Cheapest leg into `stop` that a route may use; 0 if there is none, which bounds nothing.
inline double cheapest_into(const Instance& in, int stop) {
    const int task = stop % in.n;
    double least = kInf;
    for (int from = 0; from < in.stops(); ++from) {
        const bool phantom = from >= in.n && (in.visits >> (from - in.n) & 1u);
        const bool own = from % in.n == task && !(stop >= in.n && from == task);
        if (!phantom && !own) least = std::min(least, in.to(stop, from));
    }
    return std::isfinite(least) ? least : 0.0;
}

inline Instance make_instance(const double* cost, std::size_t locations, std::int64_t start,
                       const std::int32_t* first, const std::int32_t* last, const bool* visit,
                       int n, int take, int capacity) {
    Instance in;
    in.n = n, in.take = take, in.capacity = capacity;
    std::vector<std::size_t> at(2 * n);
    for (int i = 0; i < n; ++i) {
        at[i] = static_cast<std::size_t>(first[i]);
        at[n + i] = static_cast<std::size_t>(visit[i] ? first[i] : last[i]);
        if (visit[i]) in.visits |= 1u << i;
    }
    const auto read = [&](std::size_t a, std::size_t b) {
        const double value = cost[a * locations + b];
        if (!(value >= 0)) throw std::invalid_argument("cost has a negative or NaN entry");
        return value;
    };
    in.from_start.resize(n);
    for (int i = 0; i < n; ++i) in.from_start[i] = read(static_cast<std::size_t>(start), at[i]);
    in.leg.resize(static_cast<std::size_t>(4) * n * n);
    for (int to = 0; to < 2 * n; ++to)
        for (int from = 0; from < 2 * n; ++from) in.leg[to * 2 * n + from] = read(at[from], at[to]);
    // With these prices no leg gets back more than it costs, so they bound without a relaxed route.
    in.price.resize(2 * n), in.by_price.resize(n);
    for (int i = 0; i < n; ++i) {
        in.price[i] = cheapest_into(in, i);
        in.price[n + i] = visit[i] ? 0.0 : cheapest_into(in, n + i);
    }
    in.sort_by_price();
    return in;
}

// Least costs, less prices, of relaxed routes: from a stop on, with this many first and last stops
// still to be made. No relaxed route goes from a stop back to the one before, or to its task's first.
class Relaxed {
public:
    explicit Relaxed(const Instance& in) : in_(in), side_(in.take + 1), cell_(side_ * side_) {
        for (auto& cell : cell_) cell.resize(in.stops());
    }

    double to_go(int firsts, int lasts, int stop) const {
        return at(firsts, lasts)[stop].least;
    }

    // Everything anew, after the prices changed.
    void fill() {
        for (Entry& entry : at(0, 0)) entry = {0.0, kInf, -1};
        for (int lasts = 1; lasts <= in_.take; ++lasts)
            for (int firsts = 0; firsts <= lasts; ++firsts)
                if (lasts - firsts <= in_.capacity) fill(firsts, lasts);
    }

    // The bound of a whole route, and how often its relaxed route makes each stop, less how often it
    // is charged.
    double whole(std::vector<int>& surplus) const {
        surplus.assign(in_.stops(), 0);
        double bound = 0.0, least = kInf;
        for (int i = 0; i < in_.take; ++i) {
            const int task = in_.by_price[i];
            bound += in_.task_price(task);
            --surplus[task];
            if (!in_.visit(task)) --surplus[in_.n + task];
        }
        int stop = -1, firsts = in_.take, lasts = in_.take, before = -1;
        for (int task = 0; task < in_.n; ++task) {
            if (!in_.visit(task) && in_.capacity < 1) continue;
            const auto& rest = at(firsts - 1, in_.visit(task) ? lasts - 1 : lasts)[task];
            const double value = in_.from_start[task] - in_.price[task] + rest.least;
            if (value < least) least = value, stop = task;
        }
        while (stop >= 0) {
            ++surplus[stop];
            if (stop < in_.n) --firsts;
            if (stop >= in_.n || in_.visit(stop)) --lasts;
            const Entry& entry = at(firsts, lasts)[stop];
            const int next = entry.next == before ? entry.other : entry.next;
            before = stop, stop = next;
        }
        return bound + least;
    }

private:
    struct Entry {
        double least = kInf, second = kInf;  // the second goes on with another stop
        int next = -1, other = -1;
    };
    std::vector<Entry>& at(int firsts, int lasts) { return cell_[firsts * side_ + lasts]; }
    const std::vector<Entry>& at(int firsts, int lasts) const {
        return cell_[firsts * side_ + lasts];
    }

    void fill(int firsts, int lasts) {
        const int n = in_.n;
        std::vector<Entry>& here = at(firsts, lasts);
        std::fill(here.begin(), here.end(), Entry{});
        for (int to = 0; to < 2 * n; ++to) {
            const int task = to % n;
            const bool visit = in_.visit(task);
            if (to < n ? firsts == 0 || (!visit && lasts - firsts >= in_.capacity)
                       : visit || lasts == firsts)
                continue;
            const Entry& then =
                at(to < n ? firsts - 1 : firsts, to < n && !visit ? lasts : lasts - 1)[to];
            const double* leg = &in_.leg[static_cast<std::size_t>(to) * 2 * n];
            const double least = then.least - in_.price[to], second = then.second - in_.price[to];
            for (int from = 0; from < 2 * n; ++from) {
                const double value = leg[from] + (then.next == from ? second : least);
                if (!(value < here[from].second) || from == to || (to < n && from == n + to))
                    continue;
                Entry& entry = here[from];
                if (value < entry.least)
                    entry = {value, entry.least, to, entry.next};
                else
                    entry.second = value, entry.other = to;
            }
        }
    }

    const Instance& in_;
    int side_;
    std::vector<std::vector<Entry>> cell_;
};

// Raise the bound of the whole route by steps along its subgradient; Polyak's step length.
inline void set_prices(Instance& in, Relaxed& relaxed, double upper) {
    std::vector<double> best = in.price;
    std::vector<int> surplus;
    double highest = -kInf, stride = 1.0;
    for (int step = 0, idle = 0; step < kPricing; ++step) {
        relaxed.fill();
        const double bound = relaxed.whole(surplus);
        if (bound > highest)
            highest = bound, best = in.price, idle = 0;
        else if (++idle == 4)
            stride /= 2, idle = 0;
        double norm = 0.0;
        for (const int s : surplus) norm += s * s;
        if (norm == 0.0 || !(bound < upper) || upper == kInf) break;
        for (int stop = 0; stop < in.stops(); ++stop)
            in.price[stop] -= stride * (upper - bound) / norm * surplus[stop];
        in.sort_by_price();
    }
    in.price = best;
    in.sort_by_price();
    relaxed.fill();
}

}  // namespace oath::selection
