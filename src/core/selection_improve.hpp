// Selection: better routes from a given one.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "selection_bound.hpp"

namespace oath::selection {

struct Result {
    double length = kInf;
    std::vector<int> order;
    bool exact = true;
};

// Ruin and recreate (Schrimpf et al., "Record breaking optimization results using the ruin and
// recreate principle", 2000): take a few tasks off the best route, put the cheapest ones back in.
class Improve {
public:
    Improve(const Instance& in, Result& best) : in_(in), best_(best) {}

    void run(int rounds) {
        std::vector<int> order = best_.order;
        for (int round = 0; round < rounds; ++round) {
            std::vector<int> next = order;
            take_off(next, 1 + draw(std::min(5, in_.take)));
            while (next.size() < order.size() || missing(next) > 0)
                if (!put_in(next)) break;
            if (missing(next) > 0) continue;
            const double now = length_of(next);
            // Slightly worse routes lead out of dead ends.
            const double worse = 0.08 * (1.0 - static_cast<double>(round) / rounds);
            if (now < best_.length * (1.0 + worse)) order = next;
            if (now < best_.length) best_.order = next, best_.length = now;
        }
    }

private:
    int draw(int below) {
        state_ = state_ * 6364136223846793005ull + 1442695040888963407ull;
        return static_cast<int>((state_ >> 33) % static_cast<std::uint64_t>(below));
    }
    int missing(const std::vector<int>& order) const {
        int firsts = 0;
        for (const int stop : order) firsts += stop < in_.n;
        return in_.take - firsts;
    }
    double leg(int from, int to) const { return from < 0 ? in_.from_start[to] : in_.to(to, from); }
    double length_of(const std::vector<int>& order) const {
        double length = 0.0;
        int at = -1;
        for (const int stop : order) length += leg(at, stop), at = stop;
        return length;
    }
    // Take tasks off: any, or those of stops that follow one another.
    void take_off(std::vector<int>& order, int tasks) {
        const int size = static_cast<int>(order.size()), from = draw(size);
        const bool together = draw(2) == 0;
        std::uint32_t off = 0;
        for (int i = 0; i < tasks; ++i)
            off |= 1u << order[together ? (from + i) % size : draw(size)] % in_.n;
        order.erase(std::remove_if(order.begin(), order.end(),
                                   [&](int stop) { return off >> stop % in_.n & 1u; }),
                    order.end());
    }

    struct Place {
        double extra = kInf;
        int task = 0, first = 0, last = 0;  // stops before the new ones in the old order
    };

    bool put_in(std::vector<int>& order) {
        std::uint32_t on = 0;
        for (const int stop : order) on |= 1u << stop % in_.n;
        Place best;
        for (int task = 0; task < in_.n; ++task)
            if (!(on >> task & 1u)) try_places(order, task, best);
        if (best.extra == kInf) return false;
        if (!in_.visit(best.task)) order.insert(order.begin() + best.last, in_.n + best.task);
        order.insert(order.begin() + best.first, best.task);
        return true;
    }

    // What it costs to make `stop` between two others; `after` < 0: at the end.
    double detour(int before, int stop, int after) const {
        if (after < 0) return leg(before, stop);
        return leg(before, stop) + leg(stop, after) - leg(before, after);
    }

    void try_places(const std::vector<int>& order, int task, Place& best) {
        const int size = static_cast<int>(order.size()), last = in_.n + task;
        const auto at = [&](int i) { return i < 0 || i >= size ? -1 : order[i]; };
        // A little noise, so that ties and near ties fall either way.
        const double noise = 1.0 + 0.01 * draw(100);
        int load = 0;
        for (int i = 0; i <= size; ++i) {
            const double into = detour(at(i - 1), task, at(i));
            const auto offer = [&](double extra, int j) {
                if (extra * noise < best.extra) best = {extra * noise, task, i, j};
            };
            if (in_.visit(task)) {
                offer(into, i);
            } else {
                const double both = leg(at(i - 1), task) + leg(task, last);
                if (load < in_.capacity)
                    offer(i == size ? both : both + leg(last, at(i)) - leg(at(i - 1), at(i)), i);
                int carried = load;
                for (int j = i + 1; j <= size && carried < in_.capacity; ++j) {
                    carried += change(order[j - 1]);
                    if (carried >= in_.capacity && change(order[j - 1]) > 0) break;
                    offer(into + detour(order[j - 1], last, at(j)), j);
                }
            }
            if (i < size) load += change(order[i]);
        }
    }
    int change(int stop) const { return in_.visit(stop % in_.n) ? 0 : stop < in_.n ? 1 : -1; }

    const Instance& in_;
    Result& best_;
    std::uint64_t state_ = 1;
};

}  // namespace oath::selection
