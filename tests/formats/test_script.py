"""Scripts: what is read, in which order, and how mistakes are named."""

from __future__ import annotations

from pathlib import Path

import pytest

from oath.errors import BadInput
from oath.formats.script import read


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "script.yaml"
    path.write_text(text)
    return path


def test_entries_come_in_the_order_of_their_times(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        "- {at: 20, do: {intent: undo}}\n"
        '- {at: 12.5, say: "pause robot1", confirm: false}\n'
        '- {at: 20, say: "go on"}\n',
    )
    first, second, third = read(path)
    assert (first.at, first.say, first.do, first.confirm) == (12.5, "pause robot1", None, False)
    assert (second.at, second.do, second.confirm) == (20.0, {"intent": "undo"}, True)
    assert third.say == "go on"
    assert first.where == f"{path}:2"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("at: 1\nsay: x\n", "the top level is a mapping, not a list"),
        ("", "is empty"),
        ("- {at: 1}\n", "must have either `say` or `do`"),
        ("- {at: 1, say: x, do: {intent: undo}}\n", "must have either `say` or `do`"),
        ("- {at: -1, say: x}\n", "-1"),
        ("- {at: .nan, say: x}\n", "at"),
        ("- {say: x}\n", "missing"),
        ("- {at: 1, say: x}\n- {at: 2, says: x}\n", ":2: says: unknown key 'says'; did you mean"),
        ("- hello\n", "mapping"),
    ],
)
def test_mistakes_are_named(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(BadInput) as caught:
        read(written(tmp_path, text))
    assert message in str(caught.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no such file"):
        read(tmp_path / "none.yaml")
