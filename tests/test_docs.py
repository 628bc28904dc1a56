"""The examples of README, documents and docstrings run as they stand."""

from __future__ import annotations

import doctest
import importlib
import re
from pathlib import Path
from typing import Any

import pytest

DOCUMENTS = [Path("README.md"), *sorted(Path("docs").glob("*.md"))]
BLOCK = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
MODULES = sorted(
    ".".join(path.relative_to("src").with_suffix("").parts).removesuffix(".__init__")
    for path in Path("src/oath").rglob("*.py")
)


@pytest.mark.parametrize("path", DOCUMENTS, ids=str)
def test_blocks_of_documents(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    namespace: dict[str, Any] = {"__name__": "__example__"}
    for match in BLOCK.finditer(text):
        # Line breaks in front, so that an error names the line of the document.
        lines = text[: match.start(1)].count("\n")
        exec(compile("\n" * lines + match[1], str(path), "exec"), namespace)


@pytest.mark.parametrize("name", MODULES)
def test_docstrings(name: str) -> None:
    result = doctest.testmod(importlib.import_module(name), optionflags=doctest.ELLIPSIS)
    assert result.failed == 0
