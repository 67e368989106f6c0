"""Check by Bayes' rule that a test is of its hanger: "right hanger?", "right sampling rate?".

It is that hanger, as it was of late or at its baseline, or really changed; another hanger, or a bar
that nobody described; the time base is wrong; or the planes are exchanged. The shift of ln f
(modes,) since the hanger's earlier tests, or from its description, is normal about 0 with
covariance S + J C J': J (modes, 8) is how the fitted bar goes with its parameters and the time
base, C the variances of what may change, S what tests and the bar model err by. Two candidates are
compared by the modes of which both speak. Twins cannot be told apart before the named one has a
test of its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.models.bar_fit import Bar, Seen, fit_bars, seen_in
from shm.plausibility.bar_evidence import (
    LATEST,
    LEAST_MODES,
    ORDINARY,
    OTHER_CLOCK,
    TIGHTER,
    Evidence,
    Origin,
    changes_of,
    log_sum,
    weigh_change,
    weigh_description,
)
from shm.plausibility.candidate import Candidate
from shm.plausibility.limits import LIMITS
from shm.values import NAN, PLANES, Doubt, FloatArray, Hanger, ModalTest

COARSE_FACTORS = tuple(factor for factor in LIMITS.factors if abs(math.log(factor)) > 0.1)
"""Those that a description can show: area, modulus and tape leave ln f open by some percent."""


@dataclass(frozen=True, eq=False)
class Known:
    """A hanger as described, its accepted tests, oldest first (none: `()`), and its baseline's."""

    hanger: Hanger
    tests: tuple[ModalTest, ...] = ()
    baseline: tuple[ModalTest, ...] = ()


@dataclass(frozen=True)
class OtherOrigin(Origin):
    """That a test is not what it is filed as: `probability` of it, and what it is instead.

    `hanger` is the other one where `kind` is "hanger"; `factor` that of all frequencies over the
    expected ones where it is "time base". `text` is for a person.
    """

    probability: float = NAN
    text: str = ""


FILED = Origin()


def doubt_of(test: ModalTest, history: Known, others: Sequence[Known]) -> OtherOrigin | None:
    """Say why `test` is probably not of its hanger, that of `history`; None where it may well be.

    `history.tests` are its earlier accepted tests, `others` the other hangers of the bridge. None
    also where nothing can be said: fewer than three modes, or a description that is no hanger's
    (free or pinned ends, no tension).
    """
    found = _leading(test, history, others)
    if found is None or found.kind != "unknown bar":
        return found
    # Its modes may have been numbered by the description of the named hanger, which it is not.
    again = _leading(_by_rank(test), history, others)
    return again if again is not None and again.kind == "hanger" else found


def _leading(test: ModalTest, history: Known, others: Sequence[Known]) -> OtherOrigin | None:
    odds = origins(test, history, others)
    if not odds:
        return None
    total = log_sum(np.array(list(odds.values())))
    probability = -math.expm1(odds.pop(FILED) - total)
    if probability < LIMITS.doubted_from:
        return None
    leading = max(odds, key=lambda each: odds[each])
    if leading.kind == "unknown bar":
        nearly = odds[leading] - LIMITS.clearly_nats
        described = [each for each in odds if each.kind == "hanger" and odds[each] > nearly]
        leading = max(described, key=lambda each: odds[each], default=leading)
    return _misattribution(leading, probability, history.hanger)


def _by_rank(test: ModalTest) -> ModalTest:
    """Return the test with its modes numbered by their frequencies in each plane."""
    modes = sorted(test.modes, key=lambda mode: mode.frequency_hz)
    ranks = dict.fromkeys(PLANES, 0)
    numbered = []
    for mode in modes:
        ranks[mode.plane] += 1
        numbered.append(replace(mode, order=ranks[mode.plane]))
    return replace(test, modes=tuple(numbered))


def origins(test: ModalTest, history: Known, others: Sequence[Known]) -> dict[Origin, float]:
    """Log odds of where a test comes from, up to a constant; empty where nothing can be said."""
    seen = seen_in([test], history.hanger)
    if not history.hanger.as_hanger or seen.mask.sum() < LEAST_MODES:
        return {}
    others = [each for each in others if each.hanger.as_hanger]
    if not history.tests:
        others = [each for each in others if not _twins(history.hanger, each.hanger)]
    mine, rivals = _candidates(test, history, others)
    odds = {
        FILED: math.log(
            1 - LIMITS.swap - LIMITS.unknown_bar - LIMITS.time_base - LIMITS.planes_exchanged
        )
    }
    for origin, (prior, rival) in rivals.items():
        both = mine.mask & rival.mask
        if both.sum() >= LEAST_MODES:
            factor = rival.log_density(both) - mine.log_density(both)
            odds[origin] = math.log(prior) + factor
    return odds


def _misattribution(origin: Origin, probability: float, hanger: Hanger) -> OtherOrigin:
    name = f"hanger {hanger.id}"
    texts = {
        "hanger": f"The modes fit hanger {origin.hanger} rather than {name}: right hanger?",
        "unknown bar": f"No tension and no ends of {name} as described give these modes: right "
        "hanger, right description?",
        "time base": f"All frequencies are {origin.factor:.4g} times those of {name}: right "
        "sampling rate?",
        "planes": f"The modes fit {name} with its two planes exchanged: right axes of the sensors?",
    }
    return OtherOrigin(origin.kind, origin.hanger, origin.factor, probability, texts[origin.kind])


def _twins(one: Hanger, other: Hanger) -> bool:
    """Return True if two descriptions differ by less than tape and mill do."""
    near = 2 * math.sqrt(2) * one.scatter.length
    stiffness = one.bending_stiffness_n_m2 / other.bending_stiffness_n_m2
    mass = one.mass_per_length_kg_m / other.mass_per_length_kg_m
    return (
        one.kind == other.kind
        and abs(math.log(one.length_m / other.length_m)) < near
        and max(abs(math.log(stiffness)), abs(math.log(mass))) < one.scatter.section
    )


def _as_before(shift: Seen, sensitivity: FloatArray, *classes: tuple[float, ...]) -> Evidence:
    """A hanger whose modes have shifted since its earlier tests, by no more than usual."""
    return Evidence(shift, sensitivity, changes_of(*(classes or (ORDINARY, TIGHTER))))


def _candidates(
    test: ModalTest, history: Known, others: Sequence[Known]
) -> tuple[Evidence, dict[Origin, tuple[float, Evidence]]]:
    """Return the hanger of that number, and what else the test may come from with its prior."""
    every = (history, *others)
    now = {each.hanger.id: seen_in([test], each.hanger) for each in every}
    before = {
        each.hanger.id: seen_in(each.tests[-LATEST:], each.hanger) for each in every if each.tests
    }
    bars = {
        Origin("hanger", each.hanger.id): Bar.described(
            each.hanger, before.get(each.hanger.id, now[each.hanger.id])
        )
        for each in every
    }
    id_ = history.hanger.id
    seen = now[id_]
    bars[Origin("unknown bar")] = Bar.described(history.hanger, seen, any_bar=True)
    for factor in COARSE_FACTORS if not history.tests else ():
        origin = Origin("time base", factor=factor)
        bars[origin] = Bar.described(history.hanger, seen.times(1 / factor))
    fits = dict(zip(bars, fit_bars(list(bars.values())), strict=True))
    mine = fits.pop(Origin("hanger", id_))
    rivals = {origin: weigh_description(fit) for origin, fit in fits.items()}
    for origin, fit in fits.items():
        if origin.kind == "hanger" and (at := origin.hanger) in before:
            rivals[origin] = _as_before(now[at].over(before[at]), fit.way)
    if id_ not in before:
        return replace(weigh_description(mine), masses=True), _with_priors(rivals, len(others))
    shift, way = seen.over(before[id_]), mine.way
    for factor in LIMITS.factors:
        rivals[Origin("time base", factor=factor)] = _as_before(shift.times(1 / factor), way)
    if shift.mask.any():
        factor = math.exp(float(np.median(shift.log_f[shift.mask])))
        rivals[Origin("time base", factor=factor)] = _as_before(shift, way, OTHER_CLOCK)
    crossed = seen.over(before[id_].exchanged())
    rivals[Origin("planes")] = _as_before(crossed, way[::-1])
    now_or_then = weigh_change(mine, shift)
    if history.baseline:
        restored = _as_before(seen.over(seen_in(history.baseline, history.hanger)), way)
        now_or_then = replace(now_or_then, restored=restored)
    return now_or_then, _with_priors(rivals, len(others))


def _with_priors(
    rivals: dict[Origin, Evidence], others: int
) -> dict[Origin, tuple[float, Evidence]]:
    each = {
        "hanger": LIMITS.swap / max(1, others),
        "unknown bar": LIMITS.unknown_bar,
        "time base": LIMITS.time_base / (len(LIMITS.factors) + 1),
        "planes": LIMITS.planes_exchanged,
    }
    return {origin: (each[origin.kind], rival) for origin, rival in rivals.items()}


_ACTIONS = {
    "hanger": "Drop it again with `hanger = {hanger}` in its sidecar, discard it, or confirm it",
    "time base": "Correct {rate} and drop it again, discard it, or confirm it",
    "planes": "Correct the planes in {place} and drop it again, discard it, or confirm it",
}


def of_another_bar(candidate: Candidate) -> Doubt | None:
    """Modes of another hanger, of a wrong time base or of exchanged planes."""
    its = Known(candidate.hanger, tuple(candidate.earlier), tuple(candidate.reference))
    others = [Known(hanger, tuple(tests)) for hanger, tests in candidate.others]
    found = doubt_of(candidate.test, its, others)
    if found is None or found.kind == "unknown bar":
        return None  # of such a bar the first line of its posterior says that it does not fit
    why = f"The probability that it is not what it is filed as is {found.probability:.2f}."
    state = found.text[0].lower() + found.text[1:]
    return Doubt(f"right {found.kind}", state, _action(candidate, found), why)


def _action(candidate: Candidate, found: OtherOrigin) -> str:
    has_samples = candidate.fingerprint is not None
    return _ACTIONS[found.kind].format(
        hanger=found.hanger,
        rate="the sampling rate in its sidecar" if has_samples else "its frequencies",
        place="its sidecar" if has_samples else "the file",
    )


def of_other_signals(candidate: Candidate) -> Doubt | None:
    """A unit that is wrong by 1000, or an accelerometer in the hammer's place."""
    if not candidate.signals:
        return None
    return Doubt(
        "right signals",
        "; ".join(text.rstrip(".") for text in candidate.signals),
        "Correct units and channels in its sidecar and drop both again, discard it, or confirm it",
        "The hits, the motion after them and the hanger's mass do not fit together.",
    )
