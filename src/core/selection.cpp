// Which tasks one robot takes, and in which order: exact dynamic programming over reachable states.
//
// State: (picked set, delivered set, last stop). A state that served s stops comes only from states
// that served s - 1, so the search goes layer by layer. States with the same two sets form a group,
// and a group and a next stop determine the new group and the new last stop: each value is computed
// once, as a minimum over the lasts of one group, and only groups are looked up.
//
// A narrow pass, which keeps the most promising groups of each layer, gives an upper bound; the wide
// one drops every state whose value plus a lower bound of the rest reaches it. When the wide pass
// runs out of its work limit it goes on narrow, and says that it is not exact.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include "selection_bound.hpp"
#include "selection_improve.hpp"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace nb = nanobind;

namespace {

using namespace oath::selection;

constexpr int kMaxTasks = 32;
constexpr std::size_t kNarrow = 128;  // groups a layer of the first pass
constexpr int kRounds = 40;           // of improving a route, per task taken
constexpr std::size_t kBeam = 512;    // groups a layer once the work limit is reached
constexpr std::int64_t kLookup = 32;  // a look-up's work, in additions

int lowest(std::uint32_t bits) { return __builtin_ctz(bits); }

// A layer's groups. `value` holds, per group, one value per picked task in the order of the task
// index: the least length that ends at the latest served stop of that task. `origin` is the last
// stop of the state before.
struct Layer {
    std::vector<std::uint64_t> keys;  // picked | delivered << 32
    std::vector<double> value;        // (groups, take)
    std::vector<std::uint8_t> origin; // (groups, take)
};

// Open addressing from keys to group numbers; key 0 (nothing picked) never occurs.
class Index {
public:
    Index() : slots_(1u << 10) {}

    // The group of `key`; `next` if it is new.
    std::uint32_t find_or_add(std::uint64_t key, std::uint32_t next) {
        if (2 * (used_ + 1) > slots_.size()) grow();
        Slot& slot = probe(key);
        if (slot.key == 0) slot = {key, next}, ++used_;
        return slot.group;
    }
    void clear() { std::fill(slots_.begin(), slots_.end(), Slot{}), used_ = 0; }

private:
    struct Slot {
        std::uint64_t key = 0;
        std::uint32_t group = 0;
    };
    Slot& probe(std::uint64_t key) {
        const std::size_t mask = slots_.size() - 1;
        std::uint64_t hash = key * 0x9E3779B97F4A7C15ull;
        hash ^= hash >> 32;
        std::size_t at = hash & mask;
        while (slots_[at].key != 0 && slots_[at].key != key) at = (at + 1) & mask;
        return slots_[at];
    }
    void grow() {
        std::vector<Slot> old(slots_.size() * 2);
        old.swap(slots_);
        for (const Slot& slot : old)
            if (slot.key != 0) probe(slot.key) = slot;
    }
    std::vector<Slot> slots_;
    std::size_t used_ = 0;
};

struct Open {  // an entry of the group in hand
    int stop;
    double value;
};

class Search {
public:
    // Without `relaxed`, prices alone bound; the first prices of an instance do so.
    Search(const Instance& in, const Relaxed* relaxed, double upper, std::size_t width,
           std::int64_t work)
        : in_(in), relaxed_(relaxed), upper_(upper), width_(width), work_(work) {}

    Result run() {
        begin();
        for (std::size_t s = 0; !layers_[s].keys.empty(); ++s) {
            fit(layers_[s]);
            layers_.emplace_back();
            index_.clear();
            for (std::size_t g = 0; g < layers_[s].keys.size(); ++g) extend(s, g);
            std::vector<double>().swap(layers_[s].value);  // only keys and origins are needed later
        }
        return trace();
    }

private:
    // What the stops that a group still has to make are charged for, from below.
    struct Rest {
        double due = 0.0;      // last stops of what is carried
        double more = 0.0;     // the cheapest tasks that still fit the count
        double dearest = 0.0;  // the dearest of those
        std::uint32_t cheap = 0;
    };
    Rest rest(std::uint32_t picked, std::uint32_t delivered) const {
        Rest rest;
        for (std::uint32_t bits = picked & ~delivered; bits; bits &= bits - 1)
            rest.due += in_.price[in_.n + lowest(bits)];
        int missing = in_.take - count(picked);
        for (std::size_t i = 0; missing > 0; ++i) {
            const int task = in_.by_price[i];
            if (picked >> task & 1u) continue;
            rest.dearest = in_.task_price(task);
            rest.more += rest.dearest;
            rest.cheap |= 1u << task;
            --missing;
        }
        return rest;
    }

    double to_go(std::uint32_t picked, std::uint32_t delivered, int stop) const {
        if (relaxed_ == nullptr) return 0.0;
        return relaxed_->to_go(in_.take - count(picked), in_.take - count(delivered), stop);
    }

    void begin() {
        layers_.assign(1, {});
        const Rest before = rest(0, 0);
        for (int task = 0; task < in_.n; ++task) {
            const bool visit = in_.visits >> task & 1u;
            if (!visit && in_.capacity < 1) continue;
            const bool cheap = before.cheap >> task & 1u;
            const double more = before.more - (cheap ? in_.task_price(task) : before.dearest);
            const double due = visit ? 0.0 : in_.price[in_.n + task];
            const std::uint32_t bit = 1u << task;
            put(layers_[0], bit, visit ? bit : 0u, task, task, in_.from_start[task], due + more, 0);
        }
    }

    // Enter a state unless it cannot beat the upper bound.
    void put(Layer& layer, std::uint32_t picked, std::uint32_t delivered, int task, int stop,
             double value, double rest_bound, int origin) {
        if (!(value + rest_bound + to_go(picked, delivered, stop) < upper_)) return;
        spent_ += kLookup;
        const std::uint64_t key = picked | static_cast<std::uint64_t>(delivered) << 32;
        if (picked == delivered && count(picked) == in_.take) {
            upper_ = value;  // only shorter ones count from here on
            best_ = {value, key, layers_.size() - 1, task, origin};
            return;
        }
        const auto next = static_cast<std::uint32_t>(layer.keys.size());
        const std::size_t group = index_.find_or_add(key, next);
        if (group == next) {
            layer.keys.push_back(key);
            layer.value.resize(layer.value.size() + in_.take, kInf);
            layer.origin.resize(layer.origin.size() + in_.take);
        }
        const std::size_t at = group * in_.take + slot(key, task);
        layer.value[at] = value;
        layer.origin[at] = static_cast<std::uint8_t>(origin);
    }

    void extend(std::size_t s, std::size_t g) {
        const std::uint64_t key = layers_[s].keys[g];
        const auto picked = static_cast<std::uint32_t>(key);
        const auto delivered = static_cast<std::uint32_t>(key >> 32);
        const std::uint32_t carried = picked & ~delivered;
        Open open[kMaxTasks];
        int size = 0;
        std::size_t at = g * in_.take;
        for (std::uint32_t bits = picked; bits; bits &= bits - 1, ++at) {
            const int task = lowest(bits);
            if (layers_[s].value[at] == kInf) continue;
            const bool at_last = (delivered & ~in_.visits) >> task & 1u;
            open[size++] = {at_last ? in_.n + task : task, layers_[s].value[at]};
        }
        const Rest left = rest(picked, delivered);
        for (std::uint32_t bits = carried; bits; bits &= bits - 1) {
            const int task = lowest(bits);
            const double bound = left.due - in_.price[in_.n + task] + left.more;
            step(open, size, picked, delivered | 1u << task, task, in_.n + task, bound);
        }
        if (count(picked) == in_.take) return;
        const bool full = count(carried) >= in_.capacity;
        for (int task = 0; task < in_.n; ++task) {
            const std::uint32_t bit = 1u << task;
            const bool visit = in_.visits & bit;
            if ((picked & bit) || (full && !visit)) continue;
            const double more =
                left.more - (left.cheap & bit ? in_.task_price(task) : left.dearest);
            const double bound = left.due + in_.price[in_.n + task] + more;
            step(open, size, picked | bit, visit ? delivered | bit : delivered, task, task, bound);
        }
    }

    void step(const Open* open, int size, std::uint32_t picked, std::uint32_t delivered, int task,
              int stop, double bound) {
        const double* leg = &in_.leg[static_cast<std::size_t>(stop) * in_.stops()];
        double least = kInf;
        int origin = 0;
        spent_ += size;
        for (int i = 0; i < size; ++i) {
            const double value = open[i].value + leg[open[i].stop];
            if (value < least) least = value, origin = open[i].stop;
        }
        put(layers_.back(), picked, delivered, task, stop, least, bound, origin);
    }

    // Narrow the layer if it is wider than the pass allows, or than the work that is left.
    void fit(Layer& layer) {
        std::int64_t ahead = 0;
        for (const std::uint64_t key : layer.keys) {
            const auto picked = static_cast<std::uint32_t>(key);
            const int more = count(picked) < in_.take ? in_.n - count(picked) : 0;
            const int next = more + count(picked) - count(static_cast<std::uint32_t>(key >> 32));
            ahead += static_cast<std::int64_t>(next) * (count(picked) + kLookup);
        }
        if (spent_ + ahead > work_) width_ = std::min(width_, kBeam);
        if (layer.keys.size() > width_) narrow(layer), exact_ = false;
    }

    void narrow(Layer& layer) const {
        const std::size_t take = static_cast<std::size_t>(in_.take);
        std::vector<std::pair<double, std::uint32_t>> rank(layer.keys.size());
        for (std::size_t g = 0; g < rank.size(); ++g) {
            const std::uint64_t key = layer.keys[g];
            const Rest left = rest(static_cast<std::uint32_t>(key),
                                   static_cast<std::uint32_t>(key >> 32));
            rank[g] = {promise(layer, g) + left.due + left.more, static_cast<std::uint32_t>(g)};
        }
        std::nth_element(rank.begin(), rank.begin() + width_, rank.end());
        rank.resize(width_);
        std::sort(rank.begin(), rank.end(),
                  [](const auto& a, const auto& b) { return a.second < b.second; });
        Layer kept;
        for (const auto& [bound, g] : rank) {
            const std::size_t at = g * take;
            kept.keys.push_back(layer.keys[g]);
            kept.value.insert(kept.value.end(), &layer.value[at], &layer.value[at] + take);
            kept.origin.insert(kept.origin.end(), &layer.origin[at], &layer.origin[at] + take);
        }
        layer = std::move(kept);
    }

    // The least of a group's values, each with its relaxed rest.
    double promise(const Layer& layer, std::size_t g) const {
        const auto picked = static_cast<std::uint32_t>(layer.keys[g]);
        const auto delivered = static_cast<std::uint32_t>(layer.keys[g] >> 32);
        double least = kInf;
        std::size_t at = g * in_.take;
        for (std::uint32_t bits = picked; bits; bits &= bits - 1, ++at) {
            const int task = lowest(bits);
            const bool at_last = (delivered & ~in_.visits) >> task & 1u;
            const double rest = to_go(picked, delivered, at_last ? in_.n + task : task);
            least = std::min(least, layer.value[at] + rest);
        }
        return least;
    }

    // Walk back from the best complete state.
    Result trace() const {
        Result result;
        result.length = best_.value, result.exact = exact_;
        if (best_.value == kInf) return result;
        auto [value, key, s, task, origin] = best_;
        for (;;) {
            const std::uint32_t bit = 1u << task;
            const bool visit = in_.visits & bit;
            const bool at_last = (key >> 32 & bit) && !visit;
            result.order.push_back(at_last ? in_.n + task : task);
            if (s == 0) break;
            if (at_last || visit) key &= ~(static_cast<std::uint64_t>(bit) << 32);
            if (!at_last) key &= ~static_cast<std::uint64_t>(bit);
            const Layer& before = layers_[--s];
            const auto found = std::find(before.keys.begin(), before.keys.end(), key);
            const auto group = static_cast<std::size_t>(found - before.keys.begin());
            task = origin % in_.n;
            origin = before.origin[group * in_.take + slot(key, task)];
        }
        std::reverse(result.order.begin(), result.order.end());
        return result;
    }

    // Place of a picked task among the values of its group.
    static int slot(std::uint64_t key, int task) {
        return count(static_cast<std::uint32_t>(key) & ((1u << task) - 1u));
    }

    struct Best {  // the shortest complete state so far
        double value = kInf;
        std::uint64_t key = 0;
        std::size_t layer = 0;
        int task = 0, origin = 0;
    };

    const Instance& in_;
    const Relaxed* relaxed_;
    double upper_;
    std::size_t width_;
    std::int64_t work_, spent_ = 0;
    bool exact_ = true;
    Best best_;
    std::vector<Layer> layers_;
    Index index_;
};

Result select(Instance in, std::int64_t work) {
    Result best = Search(in, nullptr, kInf, kNarrow, work).run();
    if (best.exact) return best;
    if (best.length < kInf) Improve(in, best).run(kRounds * in.take);
    Relaxed relaxed(in);
    set_prices(in, relaxed, best.length);
    constexpr std::size_t all = std::numeric_limits<std::size_t>::max();
    Result wide = Search(in, &relaxed, best.length, all, work).run();
    best.exact = wide.exact;  // nothing shorter exists if every state below the bound was seen
    if (wide.length < best.length) best = std::move(wide);
    if (!best.exact && best.length < kInf) Improve(in, best).run(kRounds * in.take);
    return best;
}

using Costs = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Indices = nb::ndarray<const std::int32_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Flags = nb::ndarray<const bool, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Order = nb::ndarray<nb::numpy, std::int32_t, nb::ndim<1>>;

void check(const Costs& cost, std::int64_t start, const Indices& first, const Indices& last,
           const Flags& visit, int take, int capacity) {
    const auto n = first.shape(0);
    const auto locations = static_cast<std::int64_t>(cost.shape(0));
    const auto refuse = [](const std::string& why) { throw std::invalid_argument(why); };
    if (cost.shape(1) != cost.shape(0)) refuse("cost must be square");
    if (last.shape(0) != n || visit.shape(0) != n)
        refuse("first, last and visit must have one entry per task");
    if (n > kMaxTasks) refuse(std::to_string(n) + " tasks exceed the limit of 32; cut them first");
    if (take < 0 || capacity < 0) refuse("take and capacity must not be negative");
    const auto outside = [&](std::int64_t at) { return at < 0 || at >= locations; };
    bool wrong = outside(start);
    for (std::size_t i = 0; i < n; ++i)
        wrong = wrong || outside(first.data()[i]) || outside(last.data()[i]);
    if (wrong) refuse("a location is outside of the cost matrix");
}

nb::tuple select_tasks(const Costs& cost, std::int64_t start, const Indices& first,
                       const Indices& last, const Flags& visit, int take, int capacity,
                       std::int64_t work) {
    check(cost, start, first, last, visit, take, capacity);
    const int n = static_cast<int>(first.shape(0));
    take = std::min(take, n);
    const double* costs = cost.data();
    const std::size_t locations = cost.shape(0);
    const std::int32_t *firsts = first.data(), *lasts = last.data();
    const bool* visits = visit.data();
    Result result;
    if (take > 0) {
        nb::gil_scoped_release release;
        result = select(make_instance(costs, locations, start, firsts, lasts, visits, n, take,
                                      capacity),
                        work);
    } else {
        result.length = 0.0;
    }
    auto order = std::make_unique<std::int32_t[]>(std::max<std::size_t>(1, result.order.size()));
    std::copy(result.order.begin(), result.order.end(), order.get());
    nb::capsule owner(order.get(), [](void* data) noexcept {
        delete[] static_cast<std::int32_t*>(data);
    });
    Order array(order.release(), {result.order.size()}, owner);
    return nb::make_tuple(array, result.length, result.exact);
}

}  // namespace

void bind_selection(nb::module_& m) {
    m.def("select_tasks", &select_tasks, nb::arg("cost"), nb::arg("start"), nb::arg("first"),
          nb::arg("last"), nb::arg("visit"), nb::arg("take"), nb::arg("capacity"),
          nb::arg("work") = 3'500'000,
          nb::sig("def select_tasks(cost: numpy.typing.NDArray[numpy.float64], start: int, "
                  "first: numpy.typing.NDArray[numpy.int32], "
                  "last: numpy.typing.NDArray[numpy.int32], "
                  "visit: numpy.typing.NDArray[numpy.bool_], take: int, capacity: int, "
                  "work: int = 3500000) "
                  "-> tuple[numpy.typing.NDArray[numpy.int32], float, bool]"),
          R"(Choose tasks and the shortest open pickup-and-delivery order, by dynamic programming.

Parameters
----------
cost
    (L, L) travel cost [m], row = from; inf = unreachable. Need not be symmetric.
start
    Location of the robot.
first, last
    (n,) locations of the tasks' first and last stops; n <= 32.
visit
    (n,) the task has only its first stop and loads nothing.
take
    Number of tasks to take, cut to n.
capacity
    Tasks carried at once.
work
    Additions that the wide pass may spend; about 1e9 take a second.

Returns
-------
order
    Stops in order: i is task i's first stop, n + i its last; empty if `take` tasks cannot be done.
length
    Length of the path [m]; inf if there is none.
exact
    Whether the path is proven to be shortest. The same input always gives the same answer.

Raises
------
ValueError
    More than 32 tasks, a location outside of `cost`, a negative or NaN cost.)");
}
