"""Pure noise in, never a wrong commit out: a real server on random weights."""

from __future__ import annotations

from pathlib import Path

import pytest

from noise import listen, served, write_model

REQUESTS = 104


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_noise_commits_nothing(seed: int, tmp_path: Path) -> None:
    path = tmp_path / "noise.gguf"
    write_model(path, seed)
    with served(path) as url:
        tally = listen(url, REQUESTS)
    assert (tally.requests, tally.crashes, tally.commits) == (REQUESTS, 0, 0)
    # A name that was said may come up by chance; then it is read back, and refused.
    assert tally.proposal <= REQUESTS * 0.05
    # The noise was heard: most of it had the form that was asked for.
    assert tally.unusable < REQUESTS / 2
