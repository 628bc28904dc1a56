// The compiled core: arrays in, arrays out. One file per algorithm, registered here.
#include <nanobind/nanobind.h>

namespace nb = nanobind;

void bind_selection(nb::module_& m);

NB_MODULE(_core, m) {
    m.doc() = "Compiled algorithms of OATH; every function releases the interpreter lock.";
    bind_selection(m);
}
