"""Graphs of automata: what may be left out of one without changing the words it accepts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass

# With more pairs of an edge and a state or word (about 0.1 s), simulation costs more than it saves.
_MAX_COMPARISONS = 300_000


@dataclass(frozen=True, slots=True)
class Graph:
    """An automaton with acceptance on edges or on states.

    An edge is (word, target). The bits of a word are, from the lowest: the ids that must hold,
    the ids that must not, and the acceptance sets that the edge is not in ("pending"). Taking
    conditions together is therefore `|`, and a word that is a subset of another asks for less
    and accepts at least as much.
    """

    names: tuple[str, ...]
    initial: list[int]
    edges: list[list[tuple[int, int]]]
    accepting: frozenset[int] = frozenset()

    @property
    def shift(self) -> int:
        """Where in a word the pending sets begin."""
        return 2 * len(self.names)


def minimal(words: Iterable[int]) -> list[int]:
    """Return the words of which no other is a subset, smallest first."""
    kept: list[int] = []
    for word in sorted(set(words), key=lambda word: (word.bit_count(), word)):
        for other in kept:
            if other & word == other:
                break
        else:
            kept.append(word)
    return kept


def bits(word: int) -> list[int]:
    """Return the places of the bits that are set, lowest first."""
    return [i for i in range(word.bit_length()) if word >> i & 1]


def trim(graph: Graph) -> Graph:
    """Remove states without an accepting run, and acceptance where it cannot matter.

    It matters only on cycles: an edge that leaves its component is put in every set, so that more
    states look alike.
    """
    out = [[target for _, target in edges] for edges in graph.edges]
    component = components(out)
    sets = _acceptance(graph, component)
    live = reaching(out, component, {c for c, (always, _) in sets.items() if not always})
    shift = graph.shift
    number = {state: i for i, state in enumerate(s for s in range(len(out)) if live[s])}
    edges: list[list[tuple[int, int]]] = []
    for state in number:
        edges.append([])
        for word, target in graph.edges[state]:
            pending = word >> shift if component[state] == component[target] else 0
            if target in number:
                label = word & ~(-1 << shift)
                edges[-1].append((label | pending << shift, number[target]))
    return Graph(graph.names, [number[s] for s in graph.initial if s in number], edges)


def _acceptance(graph: Graph, component: list[int]) -> dict[int, tuple[int, int]]:
    """Return, for each component with a cycle, the sets pending on all and on any of its edges."""
    shift = graph.shift
    sets: dict[int, tuple[int, int]] = {}
    for state, edges in enumerate(graph.edges):
        for word, target in edges:
            if component[state] == component[target]:
                always, ever = sets.get(component[state], (-1, 0))
                sets[component[state]] = always & word >> shift, ever | word >> shift
    return sets


def reduce(graph: Graph) -> Graph:
    """Return a graph that accepts the same words with, as a rule, fewer states and edges."""
    # The cheap test first: it leaves less to compare for the one that finds more.
    return _merge(_prune(_merge(graph)))


def _merge(graph: Graph) -> Graph:
    """Merge states that match each other's edges, and drop edges that another one covers.

    The coarsest partition in which two states of a block have, after dropping, the same edges to
    the same blocks; each then simulates the other. Only what can be reached is returned.
    """
    block = [int(state in graph.accepting) for state in range(len(graph.edges))]
    while True:
        number: dict[tuple[int, tuple[tuple[int, int], ...]], int] = {}
        refined = [
            number.setdefault((block[state], _covering(edges, block)), len(number))
            for state, edges in enumerate(graph.edges)
        ]
        if len(number) == len(set(block)):
            break
        block = refined
    edges_of = {
        refined[state]: _covering(edges, refined) for state, edges in enumerate(graph.edges)
    }
    order = list(dict.fromkeys(refined[state] for state in graph.initial))
    begin = list(range(len(order)))
    index = {old: i for i, old in enumerate(order)}
    for old in order:
        for _, target in edges_of[old]:
            if target not in index:
                index[target] = len(index)
                order.append(target)
    accepting = {refined[state] for state in graph.accepting}
    return Graph(
        graph.names,
        begin,
        [[(word, index[target]) for word, target in edges_of[old]] for old in order],
        frozenset(index[old] for old in order if old in accepting),
    )


def _covering(edges: list[tuple[int, int]], block: list[int]) -> tuple[tuple[int, int], ...]:
    """Return the edges to blocks, in a fixed order, without those that a lesser word covers."""
    words: dict[int, list[int]] = {}
    for word, target in edges:
        words.setdefault(block[target], []).append(word)
    return tuple(
        (word, target)
        for target in sorted(words)
        for word in (words[target] if len(words[target]) == 1 else minimal(words[target]))
    )


def _prune(graph: Graph) -> Graph:
    """Merge states that simulate each other; drop edges and beginnings that another one outdoes.

    This is what keeps a sequence such as ``F (a & F b)`` small: once a has been seen, waiting for
    b beats waiting for another a.
    """
    words = {word for edges in graph.edges for word, _ in edges}
    if (len(graph.edges) + len(words)) * sum(map(len, graph.edges)) > _MAX_COMPARISONS:
        return graph
    better = _simulation(graph, sorted(words))
    twin = [next(t for t in bits(better[s]) if better[t] >> s & 1) for s in range(len(better))]

    def best(own: list[tuple[int, int]]) -> list[tuple[int, int]]:
        merged = sorted({(word, twin[target]) for word, target in own})
        return [
            (word, target)
            for word, target in merged
            if not any(
                other & word == other and better[target] >> rival & 1
                for other, rival in merged
                if (other, rival) != (word, target)
            )
        ]

    # Twins are left as they are: nothing leads to them any more.
    edges = [best(own) if twin[s] == s else own for s, own in enumerate(graph.edges)]
    initial = list(dict.fromkeys(twin[state] for state in graph.initial))
    initial = [s for s in initial if not any(better[s] >> t & 1 for t in initial if t != s)]
    return Graph(graph.names, initial, edges, graph.accepting)


def _simulation(graph: Graph, words: list[int]) -> list[int]:
    """Return, for each state, those that simulate it directly, as bits.

    State t simulates s if t accepts where s does, and to each edge of s there is one of t that
    asks for less, is in as many acceptance sets, and leads to a state that simulates its target.
    """
    n = len(graph.edges)
    place = {word: i for i, word in enumerate(words)}
    edges = [[(place[word], target) for word, target in own] for own in graph.edges]
    lesser = [[_targets(own, word) for word in words] for own in graph.edges]
    accepting = sum(1 << state for state in graph.accepting)
    better = [accepting if state in graph.accepting else ~(-1 << n) for state in range(n)]
    changed = True
    while changed:
        changed = False
        for state in range(n):
            for rival in bits(better[state]):
                if not all(lesser[rival][i] & better[target] for i, target in edges[state]):
                    better[state] &= ~(1 << rival)
                    changed = True
    return better


def _targets(edges: list[tuple[int, int]], word: int) -> int:
    """Return the states, as bits, that edges lead to whose words are subsets of ``word``."""
    found = 0
    for other, target in edges:
        if other & word == other:
            found |= 1 << target
    return found


def count_through(graph: Graph) -> Graph:
    """Turn acceptance sets on edges into accepting states.

    A state remembers which set of its component it waits for; it accepts when it has waited for
    all. Sets that no edge of the component leaves pending need no counting, and outside of
    components with an accepting cycle nothing does.
    """
    component = components([[target for _, target in edges] for edges in graph.edges])
    sets = {
        c: [1 << i for i in bits(ever)]
        for c, (always, ever) in _acceptance(graph, component).items()
        if not always
    }
    shift = graph.shift
    order = [(state, 0) for state in graph.initial]
    index = {state: i for i, state in enumerate(order)}
    edges: list[list[tuple[int, int]]] = []
    for state, level in order:
        edges.append([])
        waiting = sets.get(component[state], [])
        for word, target in graph.edges[state]:
            reached = 0
            if component[state] == component[target]:
                reached = level % len(waiting) if waiting else 0
                while reached < len(waiting) and not word >> shift & waiting[reached]:
                    reached += 1
            if (target, reached) not in index:
                index[target, reached] = len(index)
                order.append((target, reached))
            edges[-1].append((word & ~(-1 << shift), index[target, reached]))
    out = [[target for _, target in own] for own in edges]
    counted = components(out)
    cycles = cyclic(out, counted)
    # What a run passes once may accept or not; if it does, it can merge with its later visits.
    accepting = frozenset(
        i
        for i, (state, level) in enumerate(order)
        if component[state] in sets
        and (level == len(sets[component[state]]) or counted[i] not in cycles)
    )
    return Graph(graph.names, list(range(len(graph.initial))), edges, accepting)


def components(out: Sequence[Sequence[int]]) -> list[int]:
    """Return each node's strongly connected component; edges lead to equal or lower numbers.

    After Tarjan, *Depth-first search and linear graph algorithms* (1972), without recursion.
    """
    visit, low, component = [0] * len(out), [0] * len(out), [-1] * len(out)
    stack: list[int] = []
    visits = found = 0
    for root in range(len(out)):
        path: list[tuple[int, Iterator[int]]] = [(root, iter((root,)))]  # enters the root below
        while path:
            node, children = path[-1]
            for child in children:
                if not visit[child]:
                    visits += 1
                    visit[child] = low[child] = visits
                    stack.append(child)
                    path.append((child, iter(out[child])))
                    break
                if component[child] < 0:
                    low[node] = min(low[node], low[child])
            else:
                path.pop()
                if path:
                    low[path[-1][0]] = min(low[path[-1][0]], low[node])
                if low[node] == visit[node] and component[node] < 0:
                    while component[node] < 0:
                        component[stack.pop()] = found
                    found += 1
    return component


def cyclic(out: Sequence[Sequence[int]], component: list[int]) -> set[int]:
    """Return the components that have a cycle."""
    return {
        component[node]
        for node, targets in enumerate(out)
        if any(component[target] == component[node] for target in targets)
    }


def reaching(
    out: Sequence[Sequence[int]], component: list[int], goals: AbstractSet[int]
) -> list[bool]:
    """Return, for each node, whether it leads to one of the components called goals."""
    reaches = [c in goals for c in range(len(out))]
    # Lower components first: what a component leads to is then decided before it is.
    for node in sorted(range(len(out)), key=component.__getitem__):
        if any(reaches[component[target]] for target in out[node]):
            reaches[component[node]] = True
    return [reaches[c] for c in component]
