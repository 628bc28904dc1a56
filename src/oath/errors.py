"""What can go wrong, in few kinds."""

from __future__ import annotations

from difflib import get_close_matches


class OathError(Exception):
    """Root of every error that this package raises on purpose."""


class BadInput(OathError):
    """A file or an argument cannot be used as it is.

    Parameters
    ----------
    problem
        What is wrong, with the value and the limit, e.g. ``speed -1 must be above 0 m/s``.
    file, field
        Where: the file's path and the field inside it, e.g. ``robots[1].speed``.
    remedy
        What to do about it.

    Examples
    --------
    >>> print(BadInput("speed -1 must be above 0", file="m.yaml", field="robots[1].speed",
    ...                remedy="give a positive speed in m/s"))
    m.yaml: robots[1].speed: speed -1 must be above 0; give a positive speed in m/s
    """

    def __init__(
        self, problem: str, *, file: str | None = None, field: str | None = None, remedy: str = ""
    ) -> None:
        self.problem, self.file, self.field, self.remedy = problem, file, field, remedy
        where = "".join(f"{part}: " for part in (file, field) if part)
        super().__init__(f"{where}{problem}" + (f"; {remedy}" if remedy else ""))


class ProviderError(OathError):
    """An implementation behind a seam (an allocator, a fleet, ...) broke its contract."""


class StoreError(OathError):
    """Something could not be stored, e.g. because the disk is full; then it has not happened."""


def did_you_mean(name: str, known: list[str]) -> str:
    """Return a remedy that names the nearest known word, or lists the known ones.

    Examples
    --------
    >>> did_you_mean("speeed", ["speed", "radius"])
    "did you mean 'speed'?"
    >>> did_you_mean("zzz", ["speed", "radius"])
    'known: radius, speed'
    """
    near = get_close_matches(name, known, n=1)
    if near:
        return f"did you mean '{near[0]}'?"
    return f"known: {', '.join(sorted(known))}" if known else "none is defined"
