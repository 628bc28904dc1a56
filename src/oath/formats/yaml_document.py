"""A YAML file as plain values that can say where each of them stands.

Stricter than YAML where YAML surprises: keys are text and appear once, aliases cannot blow a file
up, ``1e3`` is a number.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from oath.errors import BadInput

try:
    from yaml import CSafeLoader as _Base
except ImportError:  # PyYAML without libyaml: the same answers, about ten times slower
    from yaml import SafeLoader as _Base  # type: ignore[assignment]

FieldPath = tuple[str | int, ...]
"""The keys and indices that lead to a value, e.g. ``("robots", 1, "speed")``."""

MAX_DEPTH = 40
MAX_COPIES = 100_000
"""How many values aliases may add to those that are written out."""
MAX_DIGITS = 100
MAX_BYTES = 100_000_000

_MERGE = "tag:yaml.org,2002:merge"
_NUMBERS = ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float")
_COLLECTIONS = ("tag:yaml.org,2002:map", "tag:yaml.org,2002:seq")


class _Loader(_Base):
    """The safe loader, with ``1e3`` a number as in YAML 1.2 and JSON."""


_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)[eE][-+]?[0-9]+$"),
    list("-+.0123456789"),
)


def field_name(path: FieldPath) -> str:
    """Return the path as people write it.

    Examples
    --------
    >>> field_name(("robots", 1, "speed"))
    'robots[1].speed'
    >>> field_name(())
    ''
    """
    parts = (f"[{step}]" if isinstance(step, int) else f".{step}" for step in path)
    return "".join(parts).removeprefix(".")


@dataclass(frozen=True, slots=True, kw_only=True)
class Document:
    """A parsed file: its plain `value` and the nodes that know the lines."""

    file: str
    value: Any
    root: yaml.Node

    def error(self, path: FieldPath, problem: str, *, remedy: str = "") -> BadInput:
        """Return the error that says what is wrong with the value at `path`, and in which line."""
        line = self.root.start_mark.line + 1
        node: yaml.Node | None = self.root
        for step in path:
            node = _child(node, step)
            if node is None:
                break
            line = node.start_mark.line + 1
        return BadInput(
            problem, file=f"{self.file}:{line}", field=field_name(path) or None, remedy=remedy
        )


def read_bytes(path: Path, *, limit: int = MAX_BYTES) -> bytes:
    """Return the content of a file.

    Raises
    ------
    BadInput
        If there is no such file, it cannot be read, or it has more than `limit` bytes.
    """
    try:
        if path.is_dir():
            raise BadInput("is a directory", file=str(path), remedy="name a file")
        if path.stat().st_size > limit:
            raise BadInput(f"has more than {limit} bytes", file=str(path), remedy="split it")
        return path.read_bytes()
    except FileNotFoundError:
        raise BadInput("no such file", file=str(path), remedy="check the path") from None
    except (OSError, ValueError) as error:  # ValueError: a NUL in the path
        reason = getattr(error, "strerror", None) or str(error)
        raise BadInput(
            f"cannot be read ({reason})", file=str(path), remedy="check the path and its rights"
        ) from None


def read_document(path: Path, *, what: str, top: type[yaml.Node] = yaml.MappingNode) -> Document:
    """Read a YAML file whose top level is a mapping, or another kind of node.

    Parameters
    ----------
    path
        The file.
    what
        What the file should be, for the messages, e.g. ``"mission"``.
    top
        Kind of its top level.

    Raises
    ------
    BadInput
        If the file is missing, not UTF-8, not YAML, empty, of another kind, repeats a key, has a
        key that is not text, nests too deep or expands too far.
    """
    file = str(path)
    try:
        text = read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise BadInput(
            f"is not UTF-8 text (byte {error.start} is {error.object[error.start]:#04x})",
            file=file,
            remedy=f"save the {what} as UTF-8",
        ) from None
    root = _compose(text, file, what)
    if not isinstance(root, top):
        is_list = top is yaml.SequenceNode
        lines = "`- {key: value}`" if is_list else "`key: value`"
        raise BadInput(
            f"the top level is a {_noun(root)}, not a {'list' if is_list else 'mapping'}",
            file=f"{file}:{root.start_mark.line + 1}",
            remedy=f"start a {what} with {lines} lines",
        )
    _Expansion(file).measure(root)
    loader = _Loader("")
    try:
        return Document(file=file, value=_Values(file, loader).value(root, ()), root=root)
    finally:
        loader.dispose()


def _compose(text: str, file: str, what: str) -> yaml.Node:
    loader = None
    try:
        _check_depth(text, file)
        loader = _Loader(text)
        root = loader.get_single_node()
    except (yaml.YAMLError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        problem = getattr(error, "problem", None) or str(error).partition("\n")[0]
        raise BadInput(
            f"is not YAML: {problem}",
            file=f"{file}:{mark.line + 1}" if mark else file,
            remedy="check quotes, brackets and indentation there",
        ) from None
    finally:
        if loader is not None:
            loader.dispose()
    if root is None:
        raise BadInput("is empty", file=file, remedy=f"write a {what} into it")
    return root


def _check_depth(text: str, file: str) -> None:
    """Refuse what nests too deep before the composer recurses into it and overflows its stack."""
    depth = 0
    for event in yaml.parse(text, Loader=_Loader):
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
            if depth > MAX_DEPTH:
                raise _too_deep(file, event.start_mark.line + 1 if event.start_mark else 1)
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1


def _too_deep(file: str, line: int) -> BadInput:
    return BadInput(
        f"nests deeper than {MAX_DEPTH} levels", file=f"{file}:{line}", remedy="flatten it"
    )


class _Expansion:
    """Bounds how deep and how large a document gets once its aliases are followed."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.sizes: dict[int, tuple[int, int]] = {}

    def measure(self, root: yaml.Node) -> None:
        size, _ = self._size(root, 0)
        if size - len(self.sizes) > MAX_COPIES:
            raise self._error(root, f"its aliases add more than {MAX_COPIES} values")

    def _size(self, node: yaml.Node, depth: int) -> tuple[int, int]:
        """Number of values in and levels below a node; 0 values marks one still being measured."""
        known = self.sizes.get(id(node))
        if known is not None:
            if known[0] == 0:
                raise self._error(node, "an alias refers to the value that it stands in")
            if depth + known[1] > MAX_DEPTH:
                raise _too_deep(self.file, node.start_mark.line + 1)
            return known
        self.sizes[id(node)] = (0, 0)
        inner = [self._size(child, depth + 1) for child in _children(node)]
        result = (1 + sum(size for size, _ in inner), 1 + max((d for _, d in inner), default=0))
        self.sizes[id(node)] = result
        return result

    def _error(self, node: yaml.Node, problem: str) -> BadInput:
        return BadInput(
            problem, file=f"{self.file}:{node.start_mark.line + 1}", remedy="write the values out"
        )


class _Values:
    """Turns nodes into dicts, lists and scalars."""

    def __init__(self, file: str, loader: _Loader) -> None:
        self.file, self.loader = file, loader

    def value(self, node: yaml.Node, path: FieldPath) -> Any:
        if isinstance(node, yaml.ScalarNode):
            return self._scalar(node, path)
        if node.tag not in _COLLECTIONS:
            raise self._error(node, path, f"has the tag {node.tag}", "remove the tag")
        if isinstance(node, yaml.MappingNode):
            return self._mapping(node, path)
        return [self.value(child, (*path, i)) for i, child in enumerate(node.value)]

    def _scalar(self, node: yaml.ScalarNode, path: FieldPath) -> Any:
        if node.tag in _NUMBERS and len(node.value) > MAX_DIGITS:
            problem = f"the number {node.value[:12]}... has more than {MAX_DIGITS} characters"
            raise self._error(node, path, problem, "shorten it, or quote it if it is text")
        try:
            return self.loader.construct_object(node)
        except (yaml.YAMLError, ValueError, LookupError, AttributeError, OverflowError):
            # PyYAML's constructors fail in all these ways on values that do not fit their tag.
            tag = node.tag.rpartition(":")[2]
            problem = f"{node.value[:40]!r} cannot be read as YAML's {tag}"
            raise self._error(node, path, problem, "put it in quotes if it is text") from None

    def _mapping(self, node: yaml.MappingNode, path: FieldPath) -> dict[str, Any]:
        merged: dict[str, Any] = {}
        own: dict[str, Any] = {}
        for key_node, child in node.value:
            if key_node.tag == _MERGE:
                for base in child.value if isinstance(child, yaml.SequenceNode) else [child]:
                    if not isinstance(base, yaml.MappingNode):
                        raise self._error(
                            child, path, "<< needs a mapping", "name an anchor of one"
                        )
                    merged = self._mapping(base, path) | merged
                continue
            key = self._key(key_node, path)
            if key in own:
                problem = f"the key {key!r} appears twice"
                raise self._error(key_node, (*path, key), problem, "remove or rename one of them")
            own[key] = self.value(child, (*path, key))
        return merged | own

    def _key(self, node: yaml.Node, path: FieldPath) -> str:
        key = self._scalar(node, path) if isinstance(node, yaml.ScalarNode) else None
        if isinstance(key, str):
            return key
        if not isinstance(node, yaml.ScalarNode):
            raise self._error(node, path, f"a key is a {_noun(node)}", "keys must be text")
        kind = "a boolean" if isinstance(key, bool) else "empty" if key is None else "a number"
        problem = f"the key {node.value or '~'} is {kind} in YAML, not text"
        raise self._error(node, path, problem, f'put it in quotes: "{node.value}"')

    def _error(self, node: yaml.Node, path: FieldPath, problem: str, remedy: str) -> BadInput:
        where = f"{self.file}:{node.start_mark.line + 1}"
        return BadInput(problem, file=where, field=field_name(path) or None, remedy=remedy)


def _children(node: yaml.Node) -> list[yaml.Node]:
    if isinstance(node, yaml.MappingNode):
        return [part for pair in node.value for part in pair]
    return node.value if isinstance(node, yaml.SequenceNode) else []


def _child(node: yaml.Node | None, step: str | int) -> yaml.Node | None:
    """Return the node below `node` that `step` leads to, looking through merged mappings too."""
    if isinstance(node, yaml.SequenceNode):
        return node.value[step] if isinstance(step, int) and step < len(node.value) else None
    if not isinstance(node, yaml.MappingNode):
        return None
    for key, child in node.value:
        if key.tag != _MERGE and key.value == step:
            return child  # type: ignore[no-any-return]
    for key, child in node.value:
        if key.tag == _MERGE:
            for base in child.value if isinstance(child, yaml.SequenceNode) else [child]:
                found = _child(base, step)
                if found is not None:
                    return found
    return None


def _noun(node: yaml.Node) -> str:
    if isinstance(node, yaml.MappingNode):
        return "mapping"
    return "list" if isinstance(node, yaml.SequenceNode) else "single value"
