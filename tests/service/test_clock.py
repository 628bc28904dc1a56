"""The mission clock."""

from __future__ import annotations

from oath.service.clock import LONGEST, Clock


class Wall:
    """A wall clock that goes when it is told to."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def test_goes_with_its_speed() -> None:
    wall = Wall()
    clock = Clock(5.0, speed=10.0, wall=wall)
    assert clock.tick() == 5.0
    wall.now += 0.05
    assert clock.tick() == 5.0 + 10.0 * (100.05 - 100.0)


def test_holds() -> None:
    wall = Wall()
    clock = Clock(wall=wall)
    clock.paused = True
    wall.now += 0.05
    assert clock.tick() == 0.0
    clock.paused = False
    assert clock.tick() == 0.0, "the time that it was held is lost"


def test_waits_for_whoever_is_slow() -> None:
    wall = Wall()
    clock = Clock(speed=2.0, wall=wall)
    wall.now += 30.0
    assert clock.tick() == 2.0 * LONGEST
