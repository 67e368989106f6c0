"""A check of a diagnosis: effects are planted in a twin of the hanger, hidden, and diagnosed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, as_completed
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from shm.errors import ShmError, UsageError
from shm.gap.diagnose import diagnose
from shm.gap.hypotheses.contract import GapOptions
from shm.gap.twin import Twin
from shm.inference.options import Progress, silent
from shm.models.effects import EFFECTS, Parameter, Variant, parameters_of
from shm.values import (
    NAN,
    Diagnosis,
    EffectCheck,
    FloatArray,
    GapCheck,
    GapTrial,
    Hanger,
    ModalTest,
    PlantedParameter,
)
from shm.values.gap_check import Outcome
from shm.values.verdict import Outcome as Verdict

Trials: TypeAlias = tuple[GapTrial, ...]
"""The trials of one search: of one effect, or of none, with one seed."""


@dataclass(frozen=True)
class CheckOptions:
    """Hold what is tried.

    `effects` are names of the catalogue, all if empty. `baseline` is the model class of the twin,
    empty for the beam that the tests prefer. Each effect is searched once for each of `seeds`, at a
    place and with noise of its own, among `sizes` spread over its prior range. `sound` twins have
    no effect.
    """

    effects: tuple[str, ...] = ()
    baseline: str = GapOptions().baseline
    seeds: int = 1
    sound: int = 5
    sizes: int = 4
    seed: int = 1


def check_gap(
    tests: Sequence[ModalTest],
    hanger: Hanger,
    options: CheckOptions | None = None,
    progress: Progress = silent,
) -> GapCheck:
    """Return which effects a diagnosis of these tests would find, and from which size on.

    Without `tests` the twin is the description, measured by a usual hammer test. The same tests,
    options and seed give the same result. Raises BadInput where the tests cannot be used,
    UsageError for a model class or an effect that is not there.

    Example:
        >>> check_gap(tests, hanger, CheckOptions(("point_mass",))).effects[0].size
        0.94
    """
    check = Check(tests, hanger, options or CheckOptions())
    return check.summarise(list(check.run(progress)))


class Check:
    """The searches of all effects, and the result of those that are done."""

    def __init__(self, tests: Sequence[ModalTest], hanger: Hanger, options: CheckOptions):
        if unknown := sorted(set(options.effects) - set(EFFECTS)):
            raise UsageError(
                f"there is no effect {', '.join(unknown)}.",
                remedy=f"Name some of {', '.join(EFFECTS)}.",
            )
        self.options = options
        self.twin = Twin(tests, hanger, options.baseline, options.seed)
        hidden = self.twin.invisible()
        asked = options.effects or tuple(EFFECTS)
        self.effects = tuple(name for name in asked if name not in hidden)
        self.invisible = tuple((name, hidden[name]) for name in asked if name in hidden)
        counts = [(name, options.seeds) for name in self.effects] + [("", options.sound)]
        self.searches = [(name, options.seed + k) for name, n in counts for k in range(n)]

    def run(
        self, progress: Progress = silent, executor: Executor | None = None
    ) -> Iterator[Trials]:
        """Yield the trials of each search that is done."""
        work = [(self.twin, self.options, *search) for search in self.searches]
        if executor is None:
            results = (find_smallest(*each) for each in work)
        else:
            futures = [executor.submit(find_smallest, *each) for each in work]
            results = (future.result() for future in as_completed(futures))
        for done, trials in enumerate(results, start=1):
            progress(trials[0].effect or "without an effect", done / len(work))
            yield trials

    def summarise(self, done: Sequence[Trials]) -> GapCheck:
        """Return the result of the searches that are done, in the order of the catalogue."""
        options, twin = self.options, self.twin
        ordered = sorted(done, key=lambda trials: trials[0].seed)
        of = {name: [t for t in ordered if t[0].effect == name] for name in ("", *self.effects)}
        return GapCheck(
            hanger=twin.hanger.id,
            baseline=twin.baseline,
            tests=() if twin.is_described else tuple(test.id for test in twin.tests),
            tension_n=twin.tension_n,
            misfit_percent=twin.misfit_percent,
            frequency_sd_percent=100 * float(np.sqrt(np.mean(twin.frequency_sd**2))),
            effects=tuple(self._effect(name, of[name]) for name in self.effects if of[name]),
            sound=sum(of[""], ()),
            invisible=self.invisible,
            searches=len(self.searches),
            searches_done=len(done),
            seeds=options.seeds,
            seed=options.seed,
        )

    def _effect(self, name: str, searches: Sequence[Trials]) -> EffectCheck:
        """Return the result of the searches of one effect, one a seed."""
        steps = range(self.options.sizes)
        size = _plant(self.twin, name, searches[0][0].seed)[1][0]
        smallest = sorted(
            min((t.step for t in trials if t.is_found), default=len(steps)) for trials in searches
        )
        middle = smallest[(len(smallest) - 1) // 2]
        return EffectCheck(
            effect=name,
            name=size.name,
            unit=size.unit,
            sizes=tuple(magnitude(size, step, len(steps)) for step in steps),
            found_from=middle if middle in steps else None,
            trials=sum(searches, ()),
        )


def find_smallest(twin: Twin, options: CheckOptions, effect: str, seed: int) -> Trials:
    """Return trials of an effect by halving down to the smallest size found; one of no effect."""
    variant, parameters, sides, noise = _plant(twin, effect, seed)
    low, high, trials = 0, options.sizes if effect else 1, list[GapTrial]()
    while low < high:
        step = (low + high) // 2
        shares = np.array(
            [
                side if math.isnan(each.zero) else _share(each, step, options.sizes, side)
                for each, side in zip(parameters, sides, strict=True)
            ]
        )
        tests = twin.measure(effect, variant, shares, np.random.default_rng(noise))
        diagnosis = _diagnose(tests, twin.hanger, GapOptions(options.baseline, seed=seed))
        outcome, others, probability = _judge(diagnosis, effect)
        planted = [
            PlantedParameter(each.name, each.unit, float(each.value(np.array(share))))
            for each, share in zip(parameters, shares, strict=True)
        ]
        trial = GapTrial(
            effect=effect,
            at=variant.at if effect else "",
            step=step if effect else -1,
            parameters=tuple(planted),
            seed=seed,
            outcome=outcome,
            others=others,
            probability=probability,
            seconds=diagnosis.seconds if diagnosis else NAN,
        )
        trials.append(trial)
        low, high = (low, step) if trial.is_found or not effect else (step + 1, high)
    return tuple(trials)


def _plant(
    twin: Twin, effect: str, seed: int
) -> tuple[Variant, tuple[Parameter, ...], FloatArray, int]:
    """Return a random place, the parameters there, shares of those without size, and a seed."""
    place = list(EFFECTS).index(effect) if effect else len(EFFECTS)
    rng = np.random.default_rng([seed, place])
    variant, parameters = Variant(), tuple[Parameter, ...]()
    if effect:
        variants = twin.variants(effect)
        variant = variants[int(rng.integers(len(variants)))]
        parameters = parameters_of(effect, twin.hanger, variant)
    return variant, parameters, rng.uniform(size=len(parameters)), int(rng.integers(2**32))


def _share(parameter: Parameter, step: int, sizes: int, side: float) -> float:
    """Return the share of a size's prior at a step from the weakest; `side` chooses the sign."""
    part = (step + 0.5) / sizes
    if parameter.signed:
        return 0.5 + part / 2 if side < 0.5 else 0.5 - part / 2
    return 1 - part if parameter.zero > parameter.upper else part


def magnitude(parameter: Parameter, step: int, sizes: int) -> float:
    """Return the size at a step, without its sign."""
    return float(parameter.value(np.array(_share(parameter, step, sizes, 0.0))))


def _diagnose(tests: Sequence[ModalTest], hanger: Hanger, options: GapOptions) -> Diagnosis | None:
    """Return the diagnosis; None if it refuses the tests."""
    try:
        return diagnose(tests, hanger, options)
    except ShmError:
        return None


def _judge(diagnosis: Diagnosis | None, effect: str) -> tuple[Outcome, tuple[str, ...], float]:
    """Return what the verdict says of the planted effect, the others it names, its probability."""
    if diagnosis is None:
        return "refused", (), NAN
    verdict = diagnosis.verdict
    if verdict.outcome is Verdict.NO_GAP:
        return "no gap", (), verdict.probability
    if verdict.claim is None:
        return "unexplained", (), verdict.probability
    names = dict.fromkeys(name for cause in verdict.claim.causes for name in cause.effects)
    others = tuple(name for name in names if name != effect)
    outcome: Outcome = "another cause"
    if effect in names:
        outcome = "in a group" if others else "alone"
    return outcome, others, verdict.probability
