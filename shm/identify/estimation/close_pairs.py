"""Two modes so near to each other that noise mixes their shapes.

Where two poles differ by less than noise moves them, the model's eigenvectors are any complex mix
of the two modes' shapes, and change with every hit left out. What the two span together stays, and
so does the motion in it: with real shapes as axes, it is a 2 x 2 matrix whose diagonal noise moves
no more than a single pole (Stewart and Sun 1990, ch. V.2, on invariant subspaces). The axes are
those by which each channel sees one mode most (quartimax: Neuhaus and Wrigley 1954).

Of 84 modes of simulated tests that lie within 0.1 % of another, 82 are found with it and 77 without
(tests/benchmarks/identification/cases.py, seed 33, tests 14 to 89); other modes do not feel it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.identify.contract import LEAST_HITS
from shm.identify.estimation.poles import Candidate, Pole, PoleSet, Repeats, repeats_of
from shm.values import ComplexArray, FloatArray, IntArray

_NEAR = 0.2
"""Of the half-power bandwidth: modes nearer than this are hard to tell apart in any record."""
_WITHIN = 0.8
"""Share of a shape that must lie in what the two span."""
_LEAST_SECOND = 0.1
"""Of the largest: the second singular value of two shapes that differ."""
_BLUR = 0.02
"""Of the bandwidth: what the axes' own error adds to the standard deviation of the frequency."""
_LEAST_ANGLE = 0.1
"""Sine between two shapes below which they do not say which motion is whose."""


@dataclass(frozen=True, eq=False)
class _Pair:
    """Hold two close poles and `axes` (channels, 2), orthonormal, real, one for each mode."""

    frequency_hz: float
    damping_ratio: float
    reach_hz: float
    axes: FloatArray

    @property
    def bandwidth_hz(self) -> float:
        return 2 * self.damping_ratio * self.frequency_hz


def split_close_pairs(
    candidates: Sequence[Candidate],
    repeats: Sequence[Repeats],
    models: tuple[Sequence[PoleSet], Sequence[Sequence[PoleSet]]],
    seconds: float,
    is_trusted: Callable[[Candidate, Repeats], bool],
) -> tuple[list[Candidate], list[Repeats]]:
    """Return the candidates with close pairs, one of which would be dropped, separated on axes.

    `models` are those of all hits at the final orders, and those with each hit left out. Pairs
    that remain untrusted stay unchanged; so do all below three hits. The axes are chosen so
    that noise does not rotate them: the scatter of shapes is that of the shapes without them.
    """
    known = sorted(zip(candidates, repeats, strict=True), key=lambda each: each[0].frequency_hz)
    first = 0
    while len(models[1]) >= LEAST_HITS and first + 1 < len(known):
        both = known[first : first + 2]
        one, other = (candidate for candidate, _ in both)
        near = other.frequency_hz - one.frequency_hz < _reach_hz(one, other, seconds)
        if not near or all(is_trusted(*each) for each in both):
            first += 1
            continue
        pair = _pair(one, other, seconds)
        apart = _apart(pair, (one, other), models) if pair else []
        if apart and all(is_trusted(*each) for each in apart):
            known[first : first + 2] = [
                (candidate, replace(repeat, shape=old.shape))
                for (candidate, repeat), (_, old) in zip(apart, both, strict=True)
            ]
        first += 2
    return [candidate for candidate, _ in known], [repeat for _, repeat in known]


def _reach_hz(one: Candidate, other: Candidate, seconds: float) -> float:
    bandwidth_hz = 2 * min(c.damping_ratio * c.frequency_hz for c in (one, other))
    return max(1 / seconds, _NEAR * bandwidth_hz)


def _pair(one: Candidate, other: Candidate, seconds: float) -> _Pair | None:
    """Return the pair averaged over the orders that have both; None where the two are equal."""
    shapes = [pole.shape for candidate in (one, other) for pole in candidate.poles]
    vectors, values, _ = np.linalg.svd(_real_parts(shapes), full_matrices=False)
    if len(values) < 2 or values[1] < _LEAST_SECOND * values[0]:
        return None
    return _Pair(
        frequency_hz=(one.frequency_hz + other.frequency_hz) / 2,
        damping_ratio=(one.damping_ratio + other.damping_ratio) / 2,
        reach_hz=_reach_hz(one, other, seconds),
        axes=_simplest(vectors[:, :2]),
    )


def _real_parts(shapes: Sequence[ComplexArray]) -> FloatArray:
    """Return real and imaginary parts of shapes rotated to be most real, (channels, 2 n)."""
    turned = [shape * np.exp(-0.5j * np.angle(np.sum(shape**2))) for shape in shapes]
    return np.array([part for shape in turned for part in (shape.real, shape.imag)]).T


def _simplest(vectors: FloatArray) -> FloatArray:
    """Rotate two orthonormal vectors (channels, 2) so that each channel has most of one."""
    x, y = vectors.T
    squares, product = x**2 - y**2, 2 * x * y
    angle = np.arctan2(2 * squares @ product, squares @ squares - product @ product) / 4
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.asarray(vectors @ np.array([[cosine, -sine], [sine, cosine]]))


def _apart(
    pair: _Pair,
    pole_pair: tuple[Candidate, Candidate],
    models: tuple[Sequence[PoleSet], Sequence[Sequence[PoleSet]]],
) -> list[tuple[Candidate, Repeats]]:
    """Return the two modes on the pair's axes, with their repeats; empty where not seen."""
    together, without_each = models
    whole = {p.order: _on_axes(pair, p) for p in together if len(_poles_of_pair(pair, p)) == 2}
    seen = {order: both for order, both in whole.items() if both}
    if 2 * len(seen) <= len(together):
        return []
    again = [{poles.order: _on_axes(pair, poles) for poles in sets} for sets in without_each]
    entries = []
    for axis, old in enumerate(pole_pair):
        poles = tuple(both[axis] for both in seen.values())
        candidate = Candidate(old.track, poles, _BLUR * pair.bandwidth_hz)
        matches = [
            [(seen[n][axis], both[axis]) for n, both in model.items() if both and n in seen]
            for model in again
        ]
        entries.append((candidate, repeats_of(candidate, matches)))
    return entries


def _on_axes(pair: _Pair, poles: PoleSet) -> tuple[Pole, Pole] | None:
    """Return the two motions on the pair's axes that one model's poles make.

    One pole alone is the motion of both modes; None where there is no pole.
    """
    best = _poles_of_pair(pair, poles)
    if not len(best):
        return None
    shapes = poles.shapes / np.linalg.norm(poles.shapes, axis=0)
    rates = _rates(poles.frequency_hz, poles.damping_ratio)
    axes, motion = pair.axes, np.repeat(rates[best[:1]], 2)
    if len(best) == 2:
        axes = _span(shapes[:, best]) @ pair.axes
        mix = np.linalg.pinv(axes) @ shapes[:, best]
        if np.abs(np.linalg.det(mix)) > _LEAST_ANGLE:
            motion = np.diag(mix @ np.diag(rates[best]) @ np.linalg.inv(mix))
    one, other = (_pole(poles.order, *each) for each in zip(motion, axes.T, strict=True))
    return one, other


def _poles_of_pair(pair: _Pair, poles: PoleSet) -> IntArray:
    """Return the indices of one model's poles in the pair: none, one or the closest two."""
    shapes = poles.shapes / np.linalg.norm(poles.shapes, axis=0)
    inside = np.linalg.norm(pair.axes.T @ shapes, axis=0) ** 2 > _WITHIN
    middle = _rates(np.array(pair.frequency_hz), np.array(pair.damping_ratio))
    away = np.abs(_rates(poles.frequency_hz, poles.damping_ratio) - middle)
    chosen = inside & (away < 2 * np.pi * pair.reach_hz)
    return np.asarray(np.argsort(np.where(chosen, away, np.inf))[: min(2, int(np.sum(chosen)))])


def _rates(frequency_hz: FloatArray, damping_ratio: FloatArray) -> ComplexArray:
    """Return the poles of light damping in rad/s."""
    return np.asarray(2 * np.pi * frequency_hz * (1j - damping_ratio))


def _span(shapes: ComplexArray) -> FloatArray:
    """Return the projector on the two real directions with most of `shapes` (channels, 2)."""
    vectors = np.linalg.svd(_real_parts(list(shapes.T)), full_matrices=False)[0][:, :2]
    return np.asarray(vectors @ vectors.T)


def _pole(order: int, rate: complex, shape: FloatArray) -> Pole:
    frequency_hz = float(np.imag(rate)) / (2 * np.pi)
    damping_ratio = -float(np.real(rate) / np.imag(rate))
    norm = np.linalg.norm(shape)
    return Pole(order, frequency_hz, damping_ratio, (shape / norm).astype(complex))
