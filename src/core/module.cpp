// The compiled core: arrays in, arrays out. One file per algorithm, registered here.
#include <nanobind/nanobind.h>

namespace nb = nanobind;

void bind_exact(nb::module_& m);
void bind_graph(nb::module_& m);
void bind_planner(nb::module_& m);
void bind_pull(nb::module_& m);
void bind_search(nb::module_& m);
void bind_selection(nb::module_& m);
void bind_workspace(nb::module_& m);

NB_MODULE(_core, m) {
    // A server or a chat ends with its mission still alive in some thread: that is no leak.
    nb::set_leak_warnings(false);
    m.doc() = "Compiled algorithms of OATH; those that take long release the interpreter lock.";
    bind_workspace(m);
    bind_graph(m);
    bind_planner(m);
    bind_pull(m);
    bind_search(m);
    bind_exact(m);
    bind_selection(m);
}
