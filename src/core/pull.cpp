// String pulling: shortcuts along a path that keep clear of every obstacle and zone.
#include <nanobind/nanobind.h>
#include <nanobind/stl/vector.h>

#include <limits>

#include "arrays.hpp"
#include "workspace.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace oath {

// What a shortcut must keep away from: shapes of some kinds in a workspace.
struct Guard {
    const Workspace* workspace;
    double radius;
    Kinds kinds;
};

// Indices of the path's points that remain on the shortest chain of free shortcuts. Dynamic
// programming over pairs; a pair is looked at only if it would shorten what is known.
std::vector<int> pull(const std::vector<Vec>& path, const std::vector<Guard>& guards) {
    const int n = static_cast<int>(path.size());
    std::vector<double> length(n, std::numeric_limits<double>::infinity());
    std::vector<int> before(n, -1);
    if (n == 0) return {};
    length[0] = 0;
    for (int i = 0; i + 1 < n; ++i)
        for (int j = n - 1; j > i; --j) {
            const double through = length[i] + distance(path[i], path[j]);
            if (!(through < length[j] - 1e-12)) continue;
            bool free = true;
            if (j > i + 1)
                for (const Guard& g : guards)
                    if (!g.workspace->free(path[i], path[j], g.radius, g.kinds)) {
                        free = false;
                        break;
                    }
            if (free) length[j] = through, before[j] = i;
        }
    std::vector<int> kept;
    for (int i = n - 1; i >= 0; i = before[i]) kept.push_back(i);
    std::reverse(kept.begin(), kept.end());
    return kept;
}

}  // namespace oath

void bind_pull(nb::module_& m) {
    m.def(
        "pull",
        [](Points path, const oath::Workspace& workspace, double radius, oath::Kinds blocked,
           oath::Kinds costly, const oath::Workspace& zones, oath::Kinds labelled) {
            workspace.check(blocked), workspace.check(costly), zones.check(labelled);
            const std::vector<oath::Guard> guards{{&workspace, radius, std::move(blocked)},
                                                  {&workspace, 0.0, std::move(costly)},
                                                  {&zones, 0.0, std::move(labelled)}};
            const auto points = vectors(path);
            std::vector<int> kept;
            {
                nb::gil_scoped_release release;
                kept = oath::pull(points, guards);
            }
            return array(std::move(kept));
        },
        "path"_a, "workspace"_a, "radius"_a, "blocked"_a, "costly"_a, "zones"_a, "labelled"_a,
        "Indices of the points of a path (n, 2) that remain after string pulling. Shortcuts keep "
        "the radius from the blocked kinds and touch no costly kind and no labelled zone.");
}
