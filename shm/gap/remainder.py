"""What something unknown leaves in the frequencies: how much of it looks like another tension, and
the law that it follows over order, place, plane, level and temperature.

The law is sparse and linear, d = S z + B b + e, in what is left d of the likeliest fit with a free
remainder: S z is what the fit's own parameters may still follow, e scatters from datum to datum
and, alike in all tests, from mode to mode, by amounts that are integrated out. So twelve modes in
five tests count as twelve where a law is one over orders. Coefficients b have Zellner's g-prior
with the information of one datum (Kass and Wasserman 1995; Liang et al. 2008), terms are added one
by one as long as the evidence grows by more than odds of 20 to 1 for each of those tried, and what
is held out shrinks.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product

import numpy as np
import scipy

from shm.gap.attribution import Attribution
from shm.gap.contract import Design, Fit, Hypothesis
from shm.gap.noise import same_mode
from shm.gap.problem import GapProblem
from shm.values import NAN, PLANES, Compatibility, FloatArray, Hanger, LawTerm, Plane, Remainder
from shm.values.diagnosis import OverOrders, OverTests

# Judgement: a tenth of the length is as near as six to eight orders tell places apart; beyond the
# middle frequencies repeat themselves.
_PLACES = (0.1, 0.2, 0.3, 0.4, 0.5)
_ALIKE = 0.98  # of correlation: terms that no data here tell apart, of which the plainest stays
_SAME_LEVEL = 1.2  # hits within 20 % of each other are of one level (`shm.models.effects`)


@dataclass(frozen=True, eq=False)
class Term:
    """What a term does to each frequency, `values` (F,), for a coefficient of 1."""

    over_orders: OverOrders
    over_tests: OverTests
    planes: tuple[Plane, ...]
    values: FloatArray
    x_m: float = NAN
    threshold: float = NAN

    def found(self, coefficient: float, sd: float, log_bayes_factor: float) -> LawTerm:
        reach = 100 * float(max(np.ptp(self.values), np.abs(self.values).max()))
        return LawTerm(
            self.over_orders, self.over_tests, self.planes, reach * coefficient, reach * sd,
            log_bayes_factor, self.x_m, self.threshold, coefficient,
        )  # fmt: skip


def terms_of(design: Design, hanger: Hanger) -> tuple[Term, ...]:
    """Every term that these data could show, plain ones first, none twice under two names."""
    kept: list[Term] = []
    columns = np.zeros((design.frequencies, 0))
    for term in _all(design, hanger):
        size = float(np.linalg.norm(term.values))
        if size == 0:
            continue
        unit = term.values / size
        if not np.any(np.abs(columns.T @ unit) > _ALIKE):
            kept.append(term)
            columns = np.column_stack([columns, unit])
    return tuple(kept)


def _all(design: Design, hanger: Hanger) -> Iterator[Term]:
    plane = design.frequency_plane
    planes = [PLANES[k] for k in np.unique(plane)]
    choices = [tuple(planes), *((each,) for each in planes)] if len(planes) > 1 else [tuple(planes)]
    tests = list(_over_tests(design))
    orders = list(_over_orders(design, hanger))
    for (kind, threshold, grown), (shape, x_m, over), chosen in product(tests, orders, choices):
        inside = np.isin(plane, [PLANES.index(each) for each in chosen])
        yield Term(shape, kind, chosen, grown * over * inside, x_m, threshold)


def _over_orders(design: Design, hanger: Hanger) -> Iterator[tuple[OverOrders, float, FloatArray]]:
    order = design.frequency_order.astype(float)
    for kind in ("even", "order", "order squared", "alternating", "lowest orders"):
        yield kind, NAN, order_law(kind, order, NAN)
    for share in _PLACES:
        yield "local", share * hanger.length_m, order_law("local", order, share)


def order_law(kind: OverOrders, order: FloatArray, place: float) -> FloatArray:
    """What a term of coefficient 1 does to modes of `order`; `place` is a share of the length."""
    laws: dict[OverOrders, FloatArray] = {
        "even": np.ones_like(order),
        "order": order,
        "order squared": order**2,
        "alternating": np.where(order % 2 == 1, 1.0, -1.0),
        "lowest orders": order**-2,
        "local": np.sin(order * np.pi * place) ** 2,
    }
    return laws[kind]


def _over_tests(design: Design) -> Iterator[tuple[OverTests, float, FloatArray]]:
    yield "all tests", NAN, np.ones(design.frequencies)
    warmth = design.temperature_shift_k
    if np.ptp(warmth) > 1.0:  # kelvin, as `shm.models.effects` asks of the catalogue's own
        yield "temperature", NAN, warmth
    level = design.amplitude
    levels = np.unique(level)
    if levels[-1] <= _SAME_LEVEL * levels[0]:
        return
    yield "level", NAN, level
    yield "level squared", NAN, np.asarray(level**2)
    for low, high in pairwise(levels):
        if high > _SAME_LEVEL * low:
            middle = float((low + high) / 2)
            yield "above a level", middle, (level > middle).astype(float)


DESCRIBED_FROM = 0.3
"""Judgement: something unknown that is less likely than this is not worth a law."""
SURE = 3.0
"""Log Bayes factor of a term beyond the log of the number tried: odds of 20 to 1."""
_SHRUNK = 0.8  # as where a held-out gap is said to have shrunk (`shm.report.diagnosis_summary`)
_MOST_TERMS = 3  # judgement: what takes four terms is no law that a person would adopt
# Technical: scatter from mode to mode, and of the data in what they state, in factors of 2.7 and
# 2.3; the largest are gaps that are seen by eye.
_MODE_SCATTER = np.geomspace(3e-6, 2.5e-2, 10)
_FACTORS, _FACTORS_OF_UNKNOWN = np.geomspace(1, 30, 5), np.geomspace(1, 300, 8)
_STEP = 1e-3  # technical: of a standard deviation of the prior, over which tensions are linear


def remainder_of(
    problem: GapProblem, attribution: Attribution, compatible: Compatibility
) -> Remainder | None:
    """None where something unknown neither leads nor has a probability of `DESCRIBED_FROM`, and
    the bounds of the errors keep some explanation."""
    possible = attribution.unexplained_probability >= DESCRIBED_FROM
    if not (possible or attribution.leads == "unexplained" or not compatible.not_falsified):
        return None
    fit = attribution.unexplained
    count = problem.design.frequencies
    left = (problem.observations.value - fit.predicted)[:count]
    share, tension = like_tension(left, tension_slopes(problem, fit))
    found = Remainder(100 * _rms(left), share, 100 * tension)
    return with_law(found, Left.of(problem, fit, left), terms_of(problem.design, problem.hanger))


def tension_slopes(problem: GapProblem, fit: Fit) -> FloatArray:
    """How the logarithms of the frequencies (F,) change with that of the tension; else empty."""
    column = problem.coordinates(fit.hypothesis).tension
    if not len(column):
        return np.zeros(0)
    z = np.stack([fit.z, fit.z])
    z[:, column[0]] += [-_STEP, _STEP]
    step = float(np.diff(np.log(problem.tension_n(fit.hypothesis, z)))[0]) / (2 * _STEP)
    return np.asarray(fit.slopes[: problem.design.frequencies, column[0]] / step)


def like_tension(left: FloatArray, slopes: FloatArray) -> tuple[float, float]:
    """The share of the root mean square of `left` (F,) along `slopes` (F,), and that change."""
    if not len(slopes) or not np.any(left):
        return NAN, NAN
    change = float(slopes @ left / (slopes @ slopes))
    return abs(change) * _rms(slopes) / _rms(left), change


@dataclass(frozen=True, eq=False)
class Left:
    """What is left `value` (F,), its stated errors `errors` (F, F), what the fit may still follow
    `followed` (F, F), and which data are of one mode, `same` (F, F)."""

    value: FloatArray
    errors: FloatArray
    followed: FloatArray
    same: FloatArray
    factors: FloatArray

    @classmethod
    def of(cls, problem: GapProblem, fit: Fit, value: FloatArray) -> Left:
        nodes = problem.likelihood(Hypothesis()).nodes
        least = min(nodes, key=lambda node: node.model_error)
        slopes = fit.slopes[: len(value)]
        stated = np.isfinite(problem.observations.sd[: len(value)]).all()
        return cls(
            value,
            least.covariance.frequency,
            np.asarray(slopes @ slopes.T),
            same_mode(problem.design),
            _FACTORS if stated else _FACTORS_OF_UNKNOWN,
        )

    def covariances(self) -> FloatArray:
        """Every size of the scatter (nodes, F, F), one as likely as the other."""
        return np.array(
            [
                factor**2 * self.errors + scatter**2 * self.same + self.followed
                for factor in self.factors
                for scatter in _MODE_SCATTER
            ]
        )


class _Evidence:
    """The evidence of laws of `terms` (F, all), for every size of the scatter."""

    def __init__(self, left: Left, terms: FloatArray):
        self.left, self.terms, self.g = left, terms, float(len(left.value))
        self.covariances = left.covariances()
        lower = np.linalg.cholesky(self.covariances)
        white = np.linalg.solve(lower, np.column_stack([terms, left.value]))
        self._terms, self._value = white[..., :-1], white[..., -1]
        volume = np.log(np.einsum("kii->ki", lower)).sum(axis=1)
        self._none: FloatArray = np.asarray(-volume - (self._value**2).sum(axis=1) / 2)

    def by_node(self, chosen: Sequence[int]) -> FloatArray:
        """Log evidences (nodes,) of the law of some terms, but for a constant."""
        if not chosen:
            return self._none
        own = self._terms[:, :, list(chosen)]
        along = np.einsum("kij,ki->kj", own, self._value)
        gram = np.einsum("kij,kil->kjl", own, own) + _least(own)
        gained = np.einsum("kj,kj->k", along, np.linalg.solve(gram, along[..., None])[..., 0])
        paid = len(chosen) * np.log1p(self.g)
        return np.asarray(self._none + (self.g / (1 + self.g) * gained - paid) / 2)

    def log(self, chosen: Sequence[int]) -> float:
        return float(scipy.special.logsumexp(self.by_node(chosen)))

    def coefficients(self, chosen: Sequence[int]) -> tuple[FloatArray, FloatArray]:
        """Of the terms (chosen,), with standard deviations, at the likeliest scatter."""
        node = int(self.by_node(chosen).argmax())
        own, share = self._terms[node][:, list(chosen)], self.g / (1 + self.g)
        inverse = np.linalg.inv(own.T @ own + _least(own[None])[0])
        mean = share * inverse @ own.T @ self._value[node]
        return np.asarray(mean), np.asarray(np.sqrt(share * np.diag(inverse)))

    def missed(self, chosen: Sequence[int], by_mode: bool) -> float:
        """The root mean square of what each mode, or each frequency, misses that is held out."""
        node = int(self.by_node(chosen).argmax())
        covariance = self.covariances[node]
        if chosen:
            terms, own = self.terms[:, list(chosen)], self._terms[node][:, list(chosen)]
            free = np.linalg.inv(own.T @ own + _least(own[None])[0])
            covariance = covariance + self.g * terms @ free @ terms.T
        precision = np.linalg.inv(covariance)
        weighed = precision @ self.left.value
        groups = self.left.same if by_mode else np.eye(len(weighed))
        held = [np.flatnonzero(row) for row in np.unique(groups, axis=0)]
        missed = [np.linalg.solve(precision[np.ix_(h, h)], weighed[h]) for h in held]
        return _rms(np.concatenate(missed))


def with_law(found: Remainder, left: Left, terms: Sequence[Term]) -> Remainder:
    """The remainder with the law that it follows, if the evidence shows one."""
    if not terms:
        return found
    evidence = _Evidence(left, np.column_stack([term.values for term in terms]))
    chosen: list[int] = []
    factors: list[float] = []
    while len(chosen) < _MOST_TERMS:
        now = evidence.log(chosen)
        gains = [
            -np.inf if k in chosen else evidence.log([*chosen, k]) - now for k in range(len(terms))
        ]
        best = int(np.argmax(gains))
        gain = gains[best] - float(np.log(len(terms)))
        by_mode = all(terms[k].over_tests == "all tests" for k in [*chosen, best])
        before, after = (evidence.missed(each, by_mode) for each in (chosen, [*chosen, best]))
        if gain <= SURE or after > _SHRUNK * before:
            break
        chosen, factors = [*chosen, best], [*factors, gain]
    if not chosen:
        return found
    by_mode = all(terms[k].over_tests == "all tests" for k in chosen)
    means, sds = evidence.coefficients(chosen)
    return replace(
        found,
        law=tuple(
            terms[k].found(float(mean), float(sd), factor)
            for k, mean, sd, factor in zip(chosen, means, sds, factors, strict=True)
        ),
        held_out_before_percent=100 * evidence.missed([], by_mode),
        held_out_after_percent=100 * evidence.missed(chosen, by_mode),
    )


def _least(own: FloatArray) -> FloatArray:
    """A trace of information (nodes, p, p) that keeps terms that are all but alike invertible."""
    size = np.einsum("kij,kij->k", own, own)
    return np.asarray(1e-10 * size[:, None, None] * np.eye(own.shape[2]))


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
