"""Conventions of the code that no linter knows: who imports whom, what runs when, what is where."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

SOURCE = Path("src/oath")
MODULES = sorted(SOURCE.rglob("*.py"))

ROWS = (
    ("errors", "_core"),
    ("model",),
    ("events",),
    ("formats",),
    ("world",),
    ("allocate", "motion", "verify"),
    ("state",),
    ("dispatch",),
    ("scene", "fleet", "store", "picture", "terminal"),
    ("commands",),
    ("instruct", "preview"),
    ("runtime",),
    ("", "bench"),
    ("training",),
    ("service",),
    ("cli",),
)
"""The rooms from bottom to top; "" is the package itself, which puts the others together."""

LAYER = {room: row for row, rooms in enumerate(ROWS) for room in rooms}


def name_of(path: Path) -> str:
    parts = path.relative_to(SOURCE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


NAMES = {name_of(path) for path in MODULES}
COMPILED = "oath._core"


def room(module: str) -> str:
    """Return the room of a module: ``oath.formats.maps`` lies in ``formats``."""
    return module.partition(".")[2].partition(".")[0]


def imported(tree: ast.AST) -> Iterator[str]:
    """Yield every module of ours that a file imports, at its top, inside functions or for types."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                yield whole if whole in {*NAMES, COMPILED} else str(node.module)


def neighbours(path: Path) -> set[str]:
    names = imported(ast.parse(path.read_text()))
    return {name for name in names if name.split(".")[0] == "oath"}


def may_import(importer: str, other: str) -> bool:
    """Whether a module may know another: of its own room, or of a row above its own."""
    if other == "oath":
        return LAYER[room(importer)] >= LAYER[""]
    return room(importer) == room(other) or LAYER[room(other)] < LAYER[room(importer)]


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_imports_go_downwards(path: Path) -> None:
    importer = name_of(path)
    assert room(importer) in LAYER, "a new room needs a row in the table"
    wrong = [other for other in neighbours(path) if not may_import(importer, other)]
    assert not wrong, f"{importer} must not import {', '.join(wrong)}"


def test_rooms_of_one_row_do_not_know_each_other() -> None:
    assert not may_import("oath.verify.motion", "oath.motion.planner")
    assert not may_import("oath.world.roadmap", "oath.dispatch")
    assert not may_import("oath.runtime", "oath")
    assert may_import("oath.verify.motion", "oath.verify.record")
    assert may_import("oath.cli", "oath")


def test_imports_are_found_wherever_they_stand() -> None:
    text = "def f():\n    from oath import runtime\nif TYPE_CHECKING:\n    import oath.model"
    assert sorted(imported(ast.parse(text))) == ["oath.model", "oath.runtime"]


HEAVY = ("numpy", "scipy", "shapely", "matplotlib", "pydantic", "yaml", "PIL", "rich", COMPILED)


@pytest.mark.parametrize("module", ["oath", "oath.cli"])
def test_importing_costs_next_to_nothing(module: str) -> None:
    code = f"import sys, {module}; print([m for m in {HEAVY} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
    assert done.stderr == ""


QUIET = """
import importlib, logging, random, sys, warnings
import numpy
state, filters = random.getstate(), list(warnings.filters)
numbers = numpy.random.get_state()[1].tolist()
for name in sys.argv[1:]:
    importlib.import_module(name)
assert random.getstate() == state, "the random numbers changed"
assert numpy.random.get_state()[1].tolist() == numbers, "numpy's random numbers changed"
assert not logging.getLogger().handlers, "logging is configured"
assert "matplotlib.pyplot" not in sys.modules, "pyplot keeps global state"
"""


def test_importing_changes_nothing() -> None:
    command = [sys.executable, "-c", QUIET, *sorted(NAMES)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("", "")
    assert done.returncode == 0


def test_the_stub_is_that_of_the_compiled_module(tmp_path: Path) -> None:
    stub = tmp_path / "_core.pyi"
    command = [sys.executable, "-m", "nanobind.stubgen", "-q", "-m", "oath._core", "-o", str(stub)]
    subprocess.run(command, check=True)
    assert (SOURCE / "_core.pyi").read_text() == stub.read_text(), "run `make stub`"


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_modules_are_short(path: Path) -> None:
    assert len(path.read_text().splitlines()) <= 500


def public(tree: ast.Module) -> Iterator[tuple[str, ast.AST]]:
    """Yield the module, its public classes and functions, and the public methods of those."""
    kinds = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef
    yield "the module", tree
    for node in tree.body:
        if isinstance(node, kinds) and not node.name.startswith("_"):
            yield node.name, node
            if isinstance(node, ast.ClassDef):
                for method in node.body:
                    if isinstance(method, kinds) and not method.name.startswith("_"):
                        yield f"{node.name}.{method.name}", method


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_public_names_say_what_they_are(path: Path) -> None:
    tree = ast.parse(path.read_text())
    nameless = [name for name, node in public(tree) if not ast.get_docstring(node)]  # type: ignore[arg-type]
    assert not nameless, f"without a docstring: {', '.join(nameless)}"


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_nothing_prints_but_the_program(path: Path) -> None:
    calls = [
        node.lineno
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id == "print"
        and room(name_of(path)) != "cli"
    ]
    assert not calls, f"print in lines {calls}"


# Spelt in parts, so that this file passes its own test.
HOSTS = ("pypi" + ".org", "python" + "hosted.org", "conda" + ".anaconda.org", "npm" + "js.org")
PLACES = re.compile("/(" + "|".join(("wo" + "rk", "ho" + "me", "ro" + "ot")) + r")/[a-z.]")


def tracked() -> list[Path]:
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        pytest.skip("this is no git repository")
    return [Path(name) for name in done.stdout.split("\0") if name and Path(name).is_file()]


def test_no_file_names_a_registry_or_a_place_on_some_machine() -> None:
    found = []
    for path in tracked():
        text = path.read_bytes().decode("utf-8", errors="ignore")
        found += [f"{path}: {host}" for host in HOSTS if host in text]
        found += [f"{path}: {match[0]}" for match in PLACES.finditer(text)]
    assert not found, "\n".join(found)
