#!/usr/bin/env bash
# Builds the core with the address and undefined-behaviour sanitizers and runs the tests of the core
# with it. Uses the python on PATH; any report ends the run with an error.
set -euo pipefail
cd "$(dirname "$0")/.."

build=build/sanitize
cmake -S . -B "$build" -DOATH_SANITIZE=ON -DCMAKE_BUILD_TYPE=RelWithDebInfo \
  -DPython_EXECUTABLE="$(python -c 'import sys; print(sys.executable)')" \
  -Dnanobind_DIR="$(python -m nanobind --cmake_dir)" >/dev/null
cmake --build "$build" -j 2 | tail -n 1

# A copy of the package with only the sanitized core, found before an installed one.
package=$(mktemp -d)
trap 'rm -rf "$package"' EXIT
cp -r src/oath "$package/oath"
rm -f "$package"/oath/_core*.so
cp "$build"/_core*.so "$package/oath/"

cxx=$(sed -n 's/^CMAKE_CXX_COMPILER:[A-Z]*=//p' "$build/CMakeCache.txt")
export PYTHONPATH="$package"
export PYTHONMALLOC=malloc # so that overruns of Python's own buffers are seen
# To a file, for pytest swallows what a dying process writes.
export ASAN_OPTIONS="detect_leaks=0:halt_on_error=1:log_path=$package/report"
export UBSAN_OPTIONS="print_stacktrace=1:halt_on_error=1:log_path=$package/report"
preload="$("$cxx" -print-file-name=libasan.so):$("$cxx" -print-file-name=libubsan.so)"

status=0
LD_PRELOAD="$preload" python - "$package" <<'PYTHON' || status=$?
import sys

import pytest

import oath._core

# An editable installation must not slip its own core in.
assert oath._core.__file__.startswith(sys.argv[1]), oath._core.__file__


class FewExamples:
    """Cut down every law: under the sanitizers the core is many times slower."""

    def pytest_itemcollected(self, item: pytest.Item) -> None:
        from hypothesis import Phase, settings  # pytest wants to import it first

        law = getattr(getattr(item, "obj", None), "_hypothesis_internal_use_settings", None)
        if law is not None:
            few = settings(law, max_examples=15, phases=[Phase.generate], database=None)
            item.obj._hypothesis_internal_use_settings = few


tests = ["tests/world", "tests/motion/test_planner.py", "tests/allocate/test_selection.py"]
sys.exit(pytest.main(["-q", "-p", "no:cacheprovider", "-m", "not slow", *tests], [FewExamples()]))
PYTHON

for report in "$package"/report.*; do
  [ -e "$report" ] || continue
  cat "$report" >&2
  status=1
done
exit "$status"
