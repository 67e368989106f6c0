"""Truths and answers of a blind trial made by hand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from shm.values import Cause, Diagnosis, EffectEstimate, TensionEstimate
from tests.benchmarks.blind.truth import Answer, PlantedKind, Richness, TrueCase, TrueEffect
from tests.helpers.diagnoses import a_diagnosis

TENSION_N = 700e3
EFFECTS = ("point_mass", "sag", "timebase", "section_loss", "bending_stiffness")
RICHNESS: tuple[Richness, ...] = (
    "two planes", "shapes", "everything", "two planes", "shapes", "everything",
    "two planes", "shapes", "everything", "one plane", "known mass", "conditions",
)  # fmt: skip
KINDS: tuple[PlantedKind, ...] = ("none", "none", "one", "one", "one", "one", "two", "unknown")


def a_truth(
    kind: PlantedKind = "one",
    effects: Sequence[str] = ("point_mass",),
    size: float = 10.0,
    case: str = "c0001",
    richness: Richness = "everything",
) -> TrueCase:
    """`effects` are planted with a mass of 12 kg; nothing is where the kind is `none`."""
    planted = () if kind == "none" else tuple(effects)
    return TrueCase(
        case=case,
        kind=kind,
        richness=richness,
        effects=tuple(TrueEffect(name, "everywhere", {"mass_kg": 12.0}, size) for name in planted),
        size=size if planted else 0.0,
        tension_n=TENSION_N,
        left_out={"none": ("sag",), "unknown": ()}.get(kind, planted),
    )


def an_answer(
    causes: Mapping[str, float],
    no_gap: float = 0.0,
    unexplained: float = 0.0,
    *,
    case: str = "c0001",
    groups: Sequence[Sequence[str]] = (),
    left_out: Sequence[str] = (),
    tension: tuple[float, float] = (1.05, 1.0),
) -> Answer:
    """Causes with their probabilities.

    `tension` is over the true one, before and after, with a standard deviation of 1 %.
    """
    diagnosis = _diagnosis(causes, no_gap, unexplained, groups, left_out, tension)
    return Answer(case, tuple(left_out), diagnosis)


def _diagnosis(
    causes: Mapping[str, float],
    no_gap: float,
    unexplained: float,
    groups: Sequence[Sequence[str]],
    left_out: Sequence[str],
    tension: tuple[float, float],
) -> Diagnosis:
    group_of = {name: number for number, group in enumerate(groups) for name in group}
    before, after = (_tension(factor) for factor in tension)
    return replace(
        a_diagnosis(),
        causes=tuple(
            a_cause(name, probability, group_of.get(name)) for name, probability in causes.items()
        ),
        groups=tuple(tuple(group) for group in groups),
        no_gap_probability=no_gap,
        unexplained_probability=unexplained,
        left_out=tuple(left_out),
        tension_before_n=before,
        tension_after_n=after,
    )


def a_cause(name: str, probability: float, group: int | None = None) -> Cause:
    size = EffectEstimate("mass_kg", "kg", 12.1, 0.5, 11.3, 12.9)
    return Cause(name, "everywhere", probability, 9.0, 12.0, -3.0, (size,), "normal", group)


def _tension(factor: float) -> TensionEstimate:
    mean, sd = TENSION_N * factor, 0.01 * TENSION_N
    return TensionEstimate(
        mean, sd, mean - 1.645 * sd, mean + 1.645 * sd, mean - 1.96 * sd, mean + 1.96 * sd
    )


def some_truths(cases: int = 384, seed: int = 1) -> tuple[TrueCase, ...]:
    """Every kind and richness in the mix of a trial, sizes from 1 to 64."""
    rng = np.random.default_rng(seed)
    return tuple(_some_truth(number, rng) for number in range(cases))


def _some_truth(number: int, rng: np.random.Generator) -> TrueCase:
    kind = KINDS[number % len(KINDS)]
    names = [str(name) for name in rng.choice(EFFECTS, 2, replace=False)]
    return a_truth(
        kind,
        {"two": names, "unknown": ["breathing_crack"]}.get(kind, names[:1]),
        size=float(64 ** rng.random()),
        case=f"c{number + 1:04d}",
        richness=RICHNESS[number // len(KINDS) % len(RICHNESS)],
    )


def plausible(truth: TrueCase, rng: np.random.Generator, *, left_out: bool = False) -> Answer:
    """Sees large effects, is right as often as it says, and fails now and then."""
    without = truth.left_out if left_out else ()
    if rng.random() < 0.01:
        return Answer(truth.case, without, None, "no mode was found")
    sure = float(rng.beta(6, 1.2))
    high, low = (sure, 1 - sure) if rng.random() < sure else (1 - sure, sure)
    name = " + ".join(effect.name for effect in truth.effects)
    wrong = str(rng.choice([each for each in EFFECTS if each != name]))
    before = 0.01 * (1 + truth.size / 8) * rng.standard_normal()
    answered = partial(
        an_answer, case=truth.case, left_out=without,
        tension=(1 + before, 1 + 0.009 * rng.standard_normal()),
    )  # fmt: skip
    if truth.kind == "none" or rng.random() > 1 / (1 + np.exp(-1.2 * (truth.size - 2.5))):
        return answered({wrong: low}, high, 0.0)
    if truth.kind == "unknown" or left_out:
        return answered({wrong: low}, 0.0, high)
    return answered({name: high, wrong: low})
