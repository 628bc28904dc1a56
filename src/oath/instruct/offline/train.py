"""Trains the offline interpreter's models: ``python -m oath.instruct.offline.train``.

The weights are the only minimum of a strictly convex function, so that whoever trains finds the
same; drawing the utterances has a fixed seed.
"""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import click
import numpy as np

from oath.instruct.offline.model import (
    WEIGHTS,
    Linear,
    Models,
    features,
    role_features,
)
from oath.instruct.offline.utterances import (
    GATED,
    Utterance,
    concepts,
    lines,
    utterances,
    vocabulary,
)

STRENGTH = 0.1
"""How strongly weights are drawn to zero, per utterance."""


def fit(rows: Sequence[set[str]], labels: Sequence[str], strength: float = STRENGTH) -> Linear:
    """Softmax regression: least cross entropy plus ``strength / 2 |weights|^2``.

    Every class weighs the same in sum up to a factor of two; features of one utterance only
    are left out.
    """
    from scipy.optimize import minimize
    from scipy.sparse import csr_array

    counts = Counter(one for row in rows for one in row)
    names = sorted(one for one, count in counts.items() if count > 1)
    index = {name: n for n, name in enumerate(names)}
    classes = sorted(set(labels))
    at, columns, values = [0], [], []
    for row in rows:
        known = sorted(index[one] for one in row if one in index)
        columns += known
        values += [1.0 / np.sqrt(max(len(known), 1))] * len(known)
        at.append(len(columns))
    x = csr_array((values, columns, at), shape=(len(rows), len(names)))
    truth = np.zeros((len(rows), len(classes)))
    truth[np.arange(len(rows)), [classes.index(one) for one in labels]] = 1.0
    share = truth.sum(axis=0)
    weight = (truth @ np.sqrt(share.mean() / share))[:, None]

    def loss(flat: np.ndarray) -> tuple[float, np.ndarray]:
        table = flat.reshape(len(names) + 1, len(classes))
        score = x @ table[:-1] + table[-1]
        score -= score.max(axis=1, keepdims=True)
        total = np.log(np.exp(score).sum(axis=1, keepdims=True))
        value = -(weight * truth * (score - total)).sum() + strength / 2 * (table**2).sum()
        error = weight * (np.exp(score - total) - truth)
        gradient = np.vstack([x.T @ error, error.sum(axis=0)]) + strength * table
        return float(value), gradient.ravel()

    start = np.zeros((len(names) + 1) * len(classes))
    best = minimize(
        loss, start, jac=True, method="L-BFGS-B", options={"maxiter": 400, "ftol": 1e-9}
    )
    table = best.x.reshape(len(names) + 1, len(classes))
    return Linear(tuple(classes), index, table[:-1], table[-1])


def train(said: Sequence[Utterance]) -> Models:
    """Both models, from utterances."""
    rows, macros = lines()
    alike = concepts(macros)
    said = [one for one in said if one.line.intent != GATED]
    intent = fit([features(one.tokens, alike) for one in said], [one.line.intent for one in said])
    spots = [(one, at, role) for one in said for at, role in one.roles]
    role = fit([role_features(one.tokens, at) for one, at, _ in spots], [r for _, _, r in spots])
    return Models(intent, role, vocabulary(rows, macros), alike)


def pack(models: Models) -> bytes:
    """The models as the file that is shipped."""
    alike = [" ".join((word, *groups)) for word, groups in sorted(models.concepts.items())]
    arrays: dict[str, np.ndarray] = {
        "words": _text(sorted(models.words)),
        "concepts": _text(alike),
    }
    for name, one in (("intent", models.intent), ("role", models.role)):
        scale = np.abs(one.weights).max() / 127.0
        keep = np.ones(len(one.weights), dtype=bool)
        arrays[f"{name}_classes"] = _text(one.classes)
        arrays[f"{name}_features"] = _text([f for f, k in zip(one.rows, keep, strict=True) if k])
        arrays[f"{name}_weights"] = np.rint(one.weights[keep] / scale).astype(np.int8)
        arrays[f"{name}_bias"] = one.bias.round(4)
        arrays[f"{name}_scale"] = np.array(scale)
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue()


def _text(words: Sequence[str]) -> np.ndarray:
    return np.frombuffer("\n".join(words).encode(), dtype=np.uint8)


def main() -> None:
    """Train on the shipped utterances and write the weights beside them."""
    said = list(utterances())
    click.echo(f"{len(said)} utterances")
    data = pack(train(said))
    Path(__file__).with_name(WEIGHTS).write_bytes(data)
    click.echo(f"{WEIGHTS}: {len(data)} bytes")


if __name__ == "__main__":
    main()
