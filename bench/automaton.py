"""Times from rule to automaton.

Run with ``python bench/automaton.py [--repeat 9]``. Ratios are to a fixed piece of pure Python
timed in the same run, so that two machines, or a busy and an idle one, can be compared.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from functools import partial

from oath.motion.buchi import translate
from oath.motion.ltl import parse


def every(pattern: str, n: int) -> str:
    """Join copies of ``pattern``, with i = 1 to n and j = i + 1 filled in."""
    return " & ".join(pattern.format(i=i, j=i + 1) for i in range(1, n + 1))


def sequence(n: int) -> str:
    """Write: visit t1 to tn one after the other."""
    rule = f"F t{n}"
    for i in range(n - 1, 0, -1):
        rule = f"F (t{i} & {rule})"
    return rule


def rules() -> dict[str, str]:
    """Return the rules to translate, by name."""
    return {
        "strict sequence of 8, 2 zones": f"{sequence(8)} & {every('(!t{j} U t{i})', 7)}"
        " & G !z1 & G !z2",
        "sequence of 8": sequence(8),
        "precedence (W) of 8, all served": f"{every('(!t{j} W t{i})', 7)} & {every('F t{i}', 8)}",
        "4 deliveries, any order": every("F d{i} & (!d{i} U p{i})", 4),
        "3 responses": every("G (a{i} -> F b{i})", 3),
        "4 responses": every("G (a{i} -> F b{i})", 4),
        "response chain of 4": "G (a -> X F b) & G (b -> X F c) & G (c -> X F d)",
        "patrol of 8": every("G F p{i}", 8),
        "5 tasks, any order": every("F t{i}", 5),
        "8 tasks, any order": every("F t{i}", 8),
    }


def median(run: Callable[[], object], repeat: int) -> float:
    """Return the median time of ``run`` [s]."""
    times = []
    for _ in range(repeat):
        begin = time.perf_counter()
        run()
        times.append(time.perf_counter() - begin)
    return statistics.median(times)


def reference() -> int:
    """Do some fixed work of the kind a translation does: sets of small integers."""
    seen = {a * 8191 & b * 127 for a in range(300) for b in range(300)}
    return sum(word.bit_count() for word in sorted(seen))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeat", type=int, default=9, help="runs per rule (default 9)")
    repeat: int = parser.parse_args().repeat
    unit = median(reference, repeat)
    print(f"{'rule':32} {'states':>6} {'edges':>6} {'median':>9} {'ratio':>7}")
    print(f"{'(reference)':32} {'':6} {'':6} {unit * 1e3:6.1f} ms {1:7.2f}")
    for name, text in rules().items():
        formula = parse(text)
        automaton = translate(formula)
        seconds = median(partial(translate, formula), repeat)
        print(
            f"{name:32} {automaton.states:6} {len(automaton.edges):6} "
            f"{seconds * 1e3:6.1f} ms {seconds / unit:7.2f}"
        )


if __name__ == "__main__":
    main()
