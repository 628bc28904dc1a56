// Layered D*-Lite on the implicit product of a roadmap and a mission automaton.
//
// A route is a chain of legs; on leg i the automaton's rule state q may change with every edge
// driven, and serving the stop at the leg's end leads to leg i + 1. One D*-Lite (Koenig & Likhachev,
// "D* Lite", AAAI 2002, optimised version) searches each leg backwards over states (node, q), so a
// change on the map is repaired only in the legs that it touches.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "graph.hpp"

namespace oath {

struct Key {
    Cost first, second;
    bool operator<(const Key& o) const {
        return first < o.first || (first == o.first && second < o.second);
    }
};

// One way to enter the roadmap from where the robot is.
struct Link {
    int node;
    Cost cost;
    int label;
};

// How the rule state moves: next[label * states + q] lists where driving an edge of that label may
// lead from q; before[...] is its inverse.
struct Drive {
    int states, labels;
    std::vector<std::vector<int>> next, before;
    Drive(int states, int labels, const std::uint8_t* table);  // (labels, states, states)
};

class Leg {
public:
    Leg(const Graph& graph, int mode, const Drive& drive, int target);

    // Where the search ends and begins. `ends[q]` is what remains after arriving in q.
    void set_ends(const std::vector<Cost>& ends);
    // `at` guides the search; it must be where the links start.
    void set_start(Vec at, std::vector<Link> links, std::vector<int> states, bool each);
    void changed(const std::vector<int>& edges);
    // Repair, or begin again when repairing has cost more than a search from scratch.
    void search();

    std::vector<int> entries() const;  // where the links lead from the start's rule states
    Cost value(int q) const;           // from the start in rule state q, kUnreachable if there is no way
    // Nodes and rule states from the start in q to the target; empty if there is none.
    std::vector<std::pair<int, int>> path(int q) const;
    int target() const { return target_; }
    const std::vector<Cost>& ends() const { return ends_; }
    long expanded() const { return expanded_; }

private:
    struct State {
        Cost g, rhs;
        int place;            // in the heap, or -1
        std::uint32_t epoch;  // older than the leg's: untouched since the last restart
    };
    struct Item {
        Key key;
        int state;
    };

    Cost g(int s) const { return states_[s].epoch == epoch_ ? states_[s].g : kUnreachable; }
    Cost rhs(int s) const { return states_[s].epoch == epoch_ ? states_[s].rhs : kUnreachable; }
    State& touch(int s);
    Cost end(int s) const;   // what arriving in s costs, if s is at the target
    Cost best(int s) const;  // least cost over the successors of s
    Cost enter(int q, const Link& link) const;
    Key key(int s) const;
    Cost bound() const;
    void renew(int node);
    void restart();
    void grow();
    bool run(long limit);
    void expand(int s);
    void update(int s);
    void push(int s, Key key);
    void remove(int s);
    void up(int place);
    void down(int place);
    void put(int place, Item item);

    const Graph* graph_;
    int mode_;
    const Drive* drive_;
    int target_;
    std::vector<Cost> ends_;
    Vec at_{0, 0};
    std::vector<Link> links_;
    std::vector<int> starts_;
    bool each_ = false;  // every start state must be settled, not just the cheapest
    Cost offset_ = 0;    // D*-Lite's k_m
    bool fresh_ = true;
    std::uint32_t epoch_ = 1;
    long expanded_ = 0, scratch_ = 0;
    std::vector<State> states_;
    std::vector<Item> heap_;
};

class Planner {
public:
    Planner(const Planner&) = delete;  // legs point into it
    Planner(const Graph& graph, int mode, Drive drive, std::vector<int> targets,
            std::vector<std::vector<std::uint8_t>> serve, std::vector<std::uint8_t> settled);

    // The robot is at `at`, in one of the rule states, on its way to stop `leg`.
    void start(int leg, Vec at, std::vector<Link> links, std::vector<std::uint8_t> states);
    void changed(const std::vector<int>& edges);
    Cost plan();  // cost of the whole route, kUnreachable if there is none
    // After a plan() without a way: the first stop that no way serves, or the last if all can be
    // served, but only so that a rule is broken.
    int blocked() const { return blocked_; }

    struct Step {
        int leg, node, state;  // node -1: the stop `leg` is served here
    };
    const std::vector<Step>& path() const { return path_; }  // of the last plan()
    long expanded() const;
    const Graph& graph() const { return *graph_; }
    const Drive& drive() const { return drive_; }
    int legs() const { return static_cast<int>(legs_.size()); }

private:
    // What remains once stop `leg` is served in rule state q, and the rule state that leads there.
    std::pair<Cost, int> rest(int leg, int q) const;
    Cost walk();
    int first_blocked() const;  // floods the product forwards

    const Graph* graph_;
    int mode_;
    Drive drive_;
    std::vector<int> targets_;
    std::vector<std::vector<std::uint8_t>> serve_;  // by leg: (states, states)
    std::vector<std::uint8_t> settled_;
    std::vector<std::unique_ptr<Leg>> legs_;
    int current_ = 0;
    std::vector<std::uint8_t> now_;
    int blocked_ = -1;
    std::vector<Step> path_;
};

}  // namespace oath
