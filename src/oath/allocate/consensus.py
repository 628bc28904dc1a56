"""Bundles by consensus: agents bid for tasks and agree by talking to their neighbours only.

Source: Choi, Brunet, How, "Consensus-based decentralized auctions for robust task allocation",
IEEE Transactions on Robotics 25 (2009): algorithms 3 and 4 and table I. Bids of gains that do not
diminish are warped as in Johnson, Choi, Ponda, How, "Allowing non-submodular score functions in
distributed task allocation" (2012).

The rounds are synchronous: all agents build, then all hear what their neighbours believed when the
round began. Symbols: y = winning bids, z = winning agents, s = when news of an agent arose.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from oath.errors import ProviderError

Mask = NDArray[np.bool_]
Belief = tuple[NDArray[np.float64], NDArray[np.intp], NDArray[np.intp]]
"""(n,) winning bids y, (n,) winning agents z, (R,) rounds in which news of each agent arose s."""

NOBODY = -1

PATIENCE = 10
"""Rounds waited for an agreement, in multiples of what diminishing gains need."""


class Gain(Protocol):
    """What a task is worth to an agent that already has others."""

    def __call__(
        self, agent: int, path: Sequence[int], /
    ) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        """Return (n,) gains of putting one more task into a path, and (n,) where it goes best.

        A task with a gain of 0 or less is not bid for.
        """
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Agreement:
    """What the agents agreed on."""

    bundles: tuple[tuple[int, ...], ...]
    """The tasks of each agent in the order in which they were won."""
    paths: tuple[tuple[int, ...], ...]
    """The same tasks in the order in which they are done."""
    rounds: int
    """Rounds until nothing changed any more."""


def agree(
    gain: Gain, tasks: int, most: Sequence[int], linked: Mask, *, rebuild: bool = True
) -> Agreement:
    """Auction tasks among agents until nothing changes for as many rounds as news may travel.

    The outcome is free of conflicts, and that of a central greedy: always the highest bid of all,
    on any graph; ties go to the lower agent. With gains that diminish it takes tasks * diameter
    rounds at most and is worth at least half of the optimum.

    Parameters
    ----------
    gain
        What tasks are worth.
    tasks
        How many there are.
    most
        (R,) tasks that each agent takes at most.
    linked
        (R, R) symmetric: who hears whom. Every agent must hear of every other.
    rebuild
        Agents build their bundles anew each round. False is the source's rule: they add to what
        they still hold. Then a task that was taken elsewhere for a while can stand behind lesser
        ones or find the bundle full for good, and outcomes differ between graphs.

    Raises
    ------
    ProviderError
        The agents do not come to an agreement: `gain` does not always give the same answer.
    """
    far = diameter(linked)
    agents = [_Agent(i, gain, tasks, most[i], len(most)) for i in range(len(most))]
    neighbours = [np.flatnonzero(row & (np.arange(len(row)) != i)) for i, row in enumerate(linked)]
    quiet, now = 0, 0
    while quiet <= far:
        now += 1
        same = _round(agents, neighbours, now, rebuild)
        quiet = quiet + 1 if same else 0
        if now > PATIENCE * (tasks + 1) * (far + 1):
            raise ProviderError(f"consensus: no agreement of {len(agents)} agents, {tasks} tasks")
    return Agreement(
        bundles=tuple(tuple(agent.bundle) for agent in agents),
        paths=tuple(tuple(agent.path) for agent in agents),
        rounds=now - quiet,
    )


def _round(
    agents: Sequence[_Agent], neighbours: Sequence[NDArray[np.intp]], now: int, rebuild: bool
) -> bool:
    """Let all build and hear; return whether everyone still believes the same."""
    before = [agent.belief() for agent in agents]
    for agent in agents:
        if rebuild:
            agent.drop(0)
        agent.build()
    said = [agent.belief() for agent in agents]
    for i, agent in enumerate(agents):
        for k in neighbours[i].tolist():
            agent.hear(k, said[k], now)
        agent.release()
    return all(
        np.array_equal(y, agent.y) and np.array_equal(z, agent.z)
        for agent, (y, z, _) in zip(agents, before, strict=True)
    )


def diameter(linked: Mask) -> int:
    """Return the most links that news must pass from one agent to another.

    Raises
    ------
    ValueError
        Some agents never hear of each other.

    Examples
    --------
    >>> diameter(np.array([[0, 1, 0], [1, 0, 1], [0, 1, 0]], dtype=bool))
    2
    """
    heard = np.eye(len(linked), dtype=np.bool_)
    steps = 0
    while not heard.all():
        more = heard | (heard.astype(np.int64) @ linked.astype(np.int64) > 0)
        if np.array_equal(more, heard):
            raise ValueError("the communication graph is not connected")
        heard, steps = more, steps + 1
    return steps


class _Agent:
    """One agent: its bundle, its path, and what it believes of everyone."""

    def __init__(self, me: int, gain: Gain, tasks: int, most: int, agents: int) -> None:
        self.me, self.gain, self.most = me, gain, most
        self.bundle: list[int] = []
        self.path: list[int] = []
        self.y = np.zeros(tasks)
        self.z = np.full(tasks, NOBODY, dtype=np.intp)
        self.s = np.zeros(agents, dtype=np.intp)

    def belief(self) -> Belief:
        """Return what it tells its neighbours: copies of y, z and s."""
        return self.y.copy(), self.z.copy(), self.s.copy()

    def build(self) -> None:
        """Add the best task that it can win, again and again (algorithm 3)."""
        while len(self.bundle) < self.most:
            gains, places = self.gain(self.me, self.path)
            # Warped: no bid exceeds an earlier one, as if the gains did diminish.
            bids = np.minimum(gains, min((self.y[task] for task in self.bundle), default=np.inf))
            wins = self._beats(bids, self.me) & (bids > 0)
            wins[self.bundle] = False
            if not wins.any():
                return
            bids[~wins] = -np.inf
            best = np.flatnonzero(bids == bids.max())
            task = int(best[np.argmax(gains[best])])  # warped bids tie; the true gain decides
            self.bundle.append(task)
            self.path.insert(int(places[task]), task)
            self.y[task], self.z[task] = bids[task], self.me

    def _beats(self, bids: NDArray[np.float64], bidder: NDArray[np.intp] | int) -> Mask:
        """(n,): the bid is above what it knows; of equal ones the lower agent's counts."""
        wins: Mask = (bids > self.y) | ((bids == self.y) & (bidder < self.z))
        return wins

    def hear(self, k: int, belief: Belief, now: int) -> None:
        """Take in what agent k believes (table I).

        The masks name whom k (`they`) and this agent (`mine`) take for the winner: k, this agent,
        nobody or, for short `other`, a third agent.
        """
        (y, z, s), me, mine = belief, self.me, self.z
        they_k, they_me, they_nobody = z == k, z == me, z == NOBODY
        they_other = ~(they_k | they_me | they_nobody)
        mine_k, mine_me, mine_nobody = mine == k, mine == me, mine == NOBODY
        mine_other = ~(mine_k | mine_me | mine_nobody)
        fourth = mine_other & (mine != z)  # not even the same third agent
        higher = self._beats(y, z)
        # One entry more, so that NOBODY = -1 is never newer nor older.
        newer, older = np.append(s > self.s, False), np.append(s < self.s, False)
        of_theirs, of_mine = newer[z], newer[mine]

        update = they_k & (
            (mine_me & higher) | mine_k | mine_nobody | (mine_other & (of_mine | higher))
        )
        update |= (they_other & of_theirs) & (
            (mine_me & higher)
            | mine_k
            | mine_nobody
            | (mine_other & ~fourth)
            | (fourth & (of_mine | higher))
        )
        update |= they_nobody & (mine_k | (mine_other & of_mine))
        reset = they_me & (mine_k | (mine_other & of_mine))
        reset |= they_other & ((mine_k & ~of_theirs) | (fourth & of_mine & older[z]))
        self.y[update], self.z[update] = y[update], z[update]
        self.y[reset], self.z[reset] = 0.0, NOBODY
        self.s = np.maximum(self.s, s)
        self.s[k] = now

    def release(self) -> None:
        """Give up the first task that it was outbid on and all after it: their bids are void."""
        lost = [n for n, task in enumerate(self.bundle) if self.z[task] != self.me]
        if lost:
            self.drop(lost[0])

    def drop(self, start: int) -> None:
        """Give up the tasks of the bundle from some place on."""
        for task in self.bundle[start:]:
            self.path.remove(task)
            if self.z[task] == self.me:
                self.y[task], self.z[task] = 0.0, NOBODY
        del self.bundle[start:]
