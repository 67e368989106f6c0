"""The terms of which a law of something unknown may be made: over the orders, in the planes, with
what the tests vary."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np

from shm.gap.contract import Design
from shm.values import NAN, PLANES, FloatArray, Hanger, LawTerm, Plane
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
    match kind:
        case "even":
            return np.ones_like(order)
        case "order":
            return order
        case "order squared":
            return np.asarray(order**2)
        case "alternating":
            return np.where(order % 2 == 1, 1.0, -1.0)
        case "lowest orders":
            return np.asarray(order**-2)
        case "local":
            return np.asarray(np.sin(order * np.pi * place) ** 2)


def _over_tests(design: Design) -> Iterator[tuple[OverTests, float, FloatArray]]:
    test = design.frequency_test
    yield "all tests", NAN, np.ones(len(test))
    warmth = np.array([each.temperature_shift_k for each in design.conditions])[test]
    if np.ptp(warmth) > 1.0:  # kelvin, as `shm.models.effects` asks of the catalogue's own
        yield "temperature", NAN, warmth
    level = np.array([each.amplitude for each in design.conditions])[test]
    levels = np.unique(level)
    if levels[-1] <= _SAME_LEVEL * levels[0]:
        return
    yield "level", NAN, level
    yield "level squared", NAN, np.asarray(level**2)
    for low, high in pairwise(levels):
        if high > _SAME_LEVEL * low:
            middle = float((low + high) / 2)
            yield "above a level", middle, (level > middle).astype(float)
