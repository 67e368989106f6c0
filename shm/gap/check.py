"""What a diagnosis would find on a hanger: effects planted in a twin of it, hidden, and diagnosed.

The twin is the baseline fitted to the hanger's tests, or its description where there are none. It
is measured as the hanger was: the same modes, sensors, errors and conditions. Its data come from
the model that the diagnosis uses, so that it shows what is visible, not what nature may do beside.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from dataclasses import dataclass, field, replace
from itertools import count

import numpy as np
import scipy

from shm.errors import ShmError, UsageError
from shm.gap.contract import GapOptions, Hypothesis
from shm.gap.data_checks import usable
from shm.gap.diagnose import diagnose
from shm.gap.fit import baseline_fit, invisible
from shm.gap.observations import observed
from shm.gap.problem import GapProblem
from shm.inference.options import Progress, silent
from shm.models import check_baseline
from shm.models.effects import EFFECTS, Parameter, Variant, check_effect_priors, parameters_of
from shm.values import (
    NAN,
    PLANES,
    AddedMass,
    Diagnosis,
    EffectCheck,
    FloatArray,
    GapCheck,
    GapTrial,
    Hanger,
    IntArray,
    ModalTest,
    Mode,
    PlantedParameter,
    ShapePoint,
)
from shm.values.gap_check import Outcome


@dataclass(frozen=True)
class CheckOptions:
    """Hold what is tried.

    `effects` are names of the catalogue, all if empty. Each is searched once for each of `seeds`,
    at a place and with noise of its own, among `sizes` spread over its prior range. `sound` twins
    have no effect. `lanes` diagnoses run at the same time, if an executor runs them.
    """

    effects: tuple[str, ...] = ()
    baseline: str = GapOptions().baseline
    seeds: int = 1
    sound: int = 5
    sizes: int = 4
    seed: int = 1
    lanes: int = 1


def usual_tests(hanger: Hanger, orders: int = 8) -> tuple[ModalTest, ...]:
    """Return usual hammer tests of a hanger without any: plain, and one with a known mass.

    Both planes, two biaxial sensors, errors as the assumptions have them where none is stated.
    Frequencies and shapes only hold the place of those that the twin predicts.
    """
    assumed, length_m = hanger.assumptions, hanger.length_m
    places_m = 0.13 * length_m, 0.29 * length_m  # within reach from the deck
    modes = tuple(
        Mode(
            plane, order, float(order), order * assumed.unstated_frequency_sd.value,
            shape=tuple(
                ShapePoint(x, math.sin(order * math.pi * x / length_m), 0.0,
                           assumed.unstated_shape_sd.value)
                for x in places_m
            ),
        )
        for plane in PLANES
        for order in range(1, orders + 1)
    )  # fmt: skip
    mass = AddedMass(0.02 * hanger.mass_per_length_kg_m * length_m, 0.3 * length_m)
    plain = ModalTest("usual", modes, hanger.id, temperature_c=10.0, amplitude=1.0)
    return plain, replace(plain, id="usual with a mass", added_mass=mass)


class Twin:
    """A simulated twin of a hanger: what it would measure with an effect of any size.

    All that this module knows of the diagnosis's internals is here.
    """

    def __init__(self, tests: Sequence[ModalTest], hanger: Hanger, baseline: str, seed: int):
        check_effect_priors(hanger)
        check_baseline(baseline, hanger)
        self.hanger = hanger
        self.is_described = not tests
        if tests:
            used = usable(tests, hanger).tests
            self._slope_sd = _slope_sds(used)
            # The twin's own amplitude slopes follow from the planted effect.
            self._take(tuple(_without_slopes(test) for test in used), baseline)
            fit = baseline_fit(self._problem, np.random.default_rng(seed))
            self._z, self.misfit_percent = fit.z, self._problem.misfit_percent(fit)
        else:
            plan = usual_tests(hanger)
            self._slope_sd = _slope_sds(plan)
            self._take(plan, baseline)
            self._z = _as_described(self._problem)
            self._take(self._tests_of(self._predicted((), self._z), self._slope_sd), baseline)
            self.misfit_percent = NAN

    def _take(self, tests: tuple[ModalTest, ...], baseline: str) -> None:
        self.tests = tests
        found = observed(tests, self.hanger)
        levels = {0.0, *found.design.survey.amplitudes} if np.isfinite(self._slope_sd).any() else ()
        if len(levels) > 1:  # a test with slopes is one at small amplitude, too
            survey = replace(found.design.survey, amplitudes=tuple(sorted(levels)))
            found = replace(found, design=replace(found.design, survey=survey))
        self._problem = GapProblem(self.hanger, baseline, found)

    @property
    def tension_n(self) -> float:
        """Return the twin's true tension; NaN of a bar without any."""
        if not self.hanger.nominal_tension_n:
            return NAN
        return float(self._problem.tension_n(Hypothesis(), self._z[None])[0])

    @property
    def frequency_sd(self) -> FloatArray:
        """Return the errors of the frequencies (F,) as stated or, where none is, as assumed.

        A gap of the hanger itself is no error of the measurement, so none is taken from the fit.
        """
        found = self._problem.observations
        stated = found.sd[: found.design.frequencies]
        usual = self.hanger.assumptions.unstated_frequency_sd.value
        rounding = 0.0 if found.rounding is None else found.rounding
        return np.where(np.isfinite(stated), stated, np.hypot(usual, rounding))

    def invisible(self) -> dict[str, str]:
        """Return the effects that these tests cannot show, and why."""
        return invisible(self._problem)

    def variants(self, effect: str) -> tuple[Variant, ...]:
        """Return the places where these tests could show an effect."""
        return EFFECTS[effect].variants(self.hanger, self._problem.design.survey)

    def measure(
        self, effect: str, variant: Variant, shares: FloatArray, rng: np.random.Generator
    ) -> tuple[ModalTest, ...]:
        """Return the tests of the twin with an effect at shares (p,) of its prior, or with none."""
        effects = ((effect, variant),) if effect else ()
        z = np.append(self._z, scipy.special.ndtri(shares))
        problem, frequencies = self._problem, self._problem.design.frequencies
        sd = np.append(self.frequency_sd, problem.observations.sd[frequencies:])
        repeated = problem.repeated.loads
        noise = sd * rng.standard_normal(len(sd))
        noise += repeated @ rng.standard_normal(repeated.shape[1])
        at_rest = self._predicted(effects, z, amplitude=0.0)[:frequencies]
        data = self._predicted(effects, z)
        slopes = data[:frequencies] - at_rest
        slopes += self._slope_sd * rng.standard_normal(frequencies)
        return self._tests_of(data + noise, slopes)

    def _predicted(
        self,
        effects: tuple[tuple[str, Variant], ...],
        z: FloatArray,
        amplitude: float | None = None,
    ) -> FloatArray:
        design, hypothesis = self._problem.design, Hypothesis(effects)
        if amplitude is None:
            return np.asarray(self._problem.predict(hypothesis, z[None])[0])
        level = tuple(replace(each, amplitude=amplitude) for each in design.conditions)
        return np.asarray(
            self._problem.predict(hypothesis, z[None], replace(design, conditions=level))[0]
        )

    def _tests_of(self, data: FloatArray, slopes: FloatArray) -> tuple[ModalTest, ...]:
        """Return modal tests of data (data,) and of amplitude slopes (F,), NaN if not known."""
        rows = count()
        return tuple(
            replace(
                test, modes=tuple(self._mode(next(rows), mode, data, slopes) for mode in test.modes)
            )
            for test in self.tests
        )

    def _mode(self, row: int, mode: Mode, data: FloatArray, slopes: FloatArray) -> Mode:
        design, first = self._problem.design, self._problem.design.frequencies
        own = np.flatnonzero(design.shape_mode == row)
        keys = zip(design.shape_place[own], design.shape_component[own], strict=True)
        values = self._scale(mode, own) * data[first + own]
        shape = dict(zip(((int(p), int(c)) for p, c in keys), values.tolist(), strict=True))
        plane, places_m = PLANES.index(mode.plane), np.array(design.places_m)
        points = []
        for point in mode.shape if len(own) else ():
            place = int(np.abs(places_m - point.x_m).argmin())
            value, cross = (shape.get((place, axis), NAN) for axis in (plane, 1 - plane))
            points.append(replace(point, value=value, cross=cross))
        frequency_hz, slope = math.exp(data[row]), float(slopes[row])
        made = replace(
            mode, frequency_hz=frequency_hz, shape=tuple(points), amplitude_slope=slope,
            amplitude_slope_sd=float(self._slope_sd[row]),
            frequency_sd_hz=mode.frequency_sd_hz * frequency_hz / mode.frequency_hz,
        )  # fmt: skip
        if not made.depends_on_amplitude:
            return made
        return replace(made, frequency_hz=frequency_hz / (1 + slope))  # that of small amplitude

    def _scale(self, mode: Mode, own: IntArray) -> float:
        """Return the size of a measured shape over that of the scaled one."""
        if not len(own):
            return 1.0
        design, observed_ = self._problem.design, self._problem.observations.value
        measured = [v for p in mode.shape for v in (p.value, p.cross) if math.isfinite(v)]
        return float(np.abs(measured).max() / np.abs(observed_[design.frequencies + own]).max())


def _as_described(problem: GapProblem) -> FloatArray:
    """Return the coordinates (d,) of the description: nominal tension, all else at its middle."""
    coordinates = problem.coordinates(Hypothesis())
    z = np.zeros(coordinates.dimension)
    for column in coordinates.tension:
        z[column] = scipy.special.ndtri(coordinates.parameters[column].share(np.array(1.0)))
    return z


def _without_slopes(test: ModalTest) -> ModalTest:
    """Return a test whose frequencies are those of one level."""
    modes = (replace(each, amplitude_slope=NAN, amplitude_slope_sd=NAN) for each in test.modes)
    return replace(test, modes=tuple(modes))


def _slope_sds(tests: Sequence[ModalTest]) -> FloatArray:
    """Return the standard deviations of the amplitude slopes (F,); NaN if not known."""
    return np.array([mode.amplitude_slope_sd for test in tests for mode in test.modes])


def check_gap(
    tests: Sequence[ModalTest],
    hanger: Hanger,
    options: CheckOptions | None = None,
    progress: Progress = silent,
    executor: Executor | None = None,
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
    return check.summarise(list(check.searched(progress, executor)))


class Check:
    """Searches of all effects, and what they say together."""

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
        seeds = range(options.seed, options.seed + options.seeds)
        none = range(options.seed, options.seed + options.sound)
        self.searches = [
            *(_Search(self.twin, options, name, seed) for name in self.effects for seed in seeds),
            *(_Search(self.twin, options, "", seed) for seed in none),
        ]

    def searched(
        self, progress: Progress = silent, executor: Executor | None = None
    ) -> Iterator[_Search]:
        """Yield each search that is done."""
        waiting, running = deque(self.searches), dict[Future[Diagnosis | None], _Search]()
        done, lanes = 0, self.options.lanes if executor else 1
        while waiting or running:
            while waiting and len(running) < lanes:
                search = waiting.popleft()
                running[_submitted(executor, search)] = search
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                search = running.pop(future)
                search.take(future.result())
                if not search.is_done:
                    running[_submitted(executor, search)] = search
                    continue
                done += 1
                progress(search.effect or "without an effect", done / len(self.searches))
                yield search

    def summarise(self, searches: Sequence[_Search]) -> GapCheck:
        """Return the result of the searches that are done, in the order of the catalogue."""
        options, twin = self.options, self.twin
        of = {name: [s for s in searches if s.effect == name] for name in ("", *self.effects)}
        return GapCheck(
            hanger=twin.hanger.id,
            baseline=options.baseline,
            tests=() if twin.is_described else tuple(test.id for test in twin.tests),
            tension_n=twin.tension_n,
            misfit_percent=twin.misfit_percent,
            frequency_sd_percent=100 * float(np.sqrt(np.mean(twin.frequency_sd**2))),
            effects=tuple(_effect_check(twin, found) for found in list(of.values())[1:] if found),
            sound=tuple(trial for search in of[""] for trial in search.trials),
            invisible=self.invisible,
            searches=len(self.searches),
            searches_done=len(searches),
            seeds=options.seeds,
            seed=options.seed,
        )


def _effect_check(twin: Twin, searches: Sequence[_Search]) -> EffectCheck:
    """Return what the searches of one effect say together, one a seed."""
    first = searches[0]
    from_each = sorted(search.high for search in searches)
    middle = from_each[(len(from_each) - 1) // 2]
    size = parameters_of(first.effect, twin.hanger, first.variant)[0]
    steps = range(first.sizes)
    return EffectCheck(
        effect=first.effect,
        name=size.name,
        unit=size.unit,
        sizes=tuple(_magnitude(size, step, first.sizes) for step in steps),
        found_from=None if middle == first.sizes else middle,
        trials=tuple(trial for search in searches for trial in search.trials),
    )


@dataclass
class _Search:
    """The search for the smallest size of one effect that is found, with one seed.

    It is at least `low` and at most `high`, which is the number of sizes if none is found.
    """

    twin: Twin
    options: CheckOptions
    effect: str
    seed: int
    trials: list[GapTrial] = field(default_factory=list)
    low: int = 0

    def __post_init__(self) -> None:
        self.sizes = self.high = self.options.sizes if self.effect else 1
        place = list(EFFECTS).index(self.effect) if self.effect else len(EFFECTS)
        rng = np.random.default_rng([self.seed, place])
        self.variant, self.parameters = Variant(), tuple[Parameter, ...]()
        if self.effect:
            variants = self.twin.variants(self.effect)
            self.variant = variants[int(rng.integers(len(variants)))]
            self.parameters = parameters_of(self.effect, self.twin.hanger, self.variant)
        self._other = rng.uniform(size=len(self.parameters))
        self._noise = int(rng.integers(2**32))

    @property
    def is_done(self) -> bool:
        """Return True if the smallest size is known."""
        return self.low == self.high

    @property
    def step(self) -> int:
        """Return the size to try next: the middle of those that are left."""
        return (self.low + self.high) // 2

    @property
    def _shares(self) -> FloatArray:
        """Return the shares (p,) of the parameters' priors; all sizes of an effect go together."""
        return np.array(
            [
                other if math.isnan(each.zero) else _share(each, self.step, self.sizes, other)
                for each, other in zip(self.parameters, self._other, strict=True)
            ]
        )

    def measured(self) -> tuple[ModalTest, ...]:
        """Return the tests of the twin with the effect of the next size."""
        rng = np.random.default_rng(self._noise)
        return self.twin.measure(self.effect, self.variant, self._shares, rng)

    def take(self, diagnosis: Diagnosis | None) -> None:
        """Note what the diagnosis of the tried size says, and go on to a smaller or larger one."""
        outcome, others, probability = _judge(diagnosis, self.effect)
        values = zip(self.parameters, self._shares, strict=True)
        trial = GapTrial(
            effect=self.effect,
            at=self.variant.at if self.effect else "",
            step=self.step if self.effect else -1,
            parameters=tuple(
                PlantedParameter(each.name, each.unit, float(each.value(np.array(share))))
                for each, share in values
            ),
            seed=self.seed,
            outcome=outcome,
            others=others,
            probability=probability,
            seconds=diagnosis.seconds if diagnosis else NAN,
        )
        self.trials.append(trial)
        if not self.effect or trial.is_found:
            self.high = self.step
        else:
            self.low = self.step + 1


def _share(parameter: Parameter, step: int, sizes: int, side: float) -> float:
    """Return the share of a size's prior at a step from the weakest; `side` chooses the sign."""
    part = (step + 0.5) / sizes
    if parameter.signed:
        return 0.5 + part / 2 if side < 0.5 else 0.5 - part / 2
    return 1 - part if parameter.zero > parameter.upper else part


def _magnitude(parameter: Parameter, step: int, sizes: int) -> float:
    """Return the size at a step, without its sign."""
    return float(parameter.value(np.array(_share(parameter, step, sizes, 0.0))))


def _submitted(executor: Executor | None, search: _Search) -> Future[Diagnosis | None]:
    options = GapOptions(search.options.baseline, seed=search.seed)
    work = search.measured(), search.twin.hanger, options
    if executor is not None:
        return executor.submit(_diagnosed, *work)
    future = Future[Diagnosis | None]()
    future.set_result(_diagnosed(*work))
    return future


def _diagnosed(tests: Sequence[ModalTest], hanger: Hanger, options: GapOptions) -> Diagnosis | None:
    """Return the diagnosis; None if it refuses the tests."""
    try:
        return diagnose(tests, hanger, options)
    except ShmError:
        return None


def _judge(diagnosis: Diagnosis | None, effect: str) -> tuple[Outcome, tuple[str, ...], float]:
    """Return what a diagnosis says of the planted effect, what it names beside it, how surely."""
    if diagnosis is None:
        return "refused", (), NAN
    leading = diagnosis.leading
    if leading is None and diagnosis.leads == "no gap":
        return "no gap", (), diagnosis.no_gap_probability
    if leading is None:
        return "unexplained", (), diagnosis.unexplained_probability
    claimed = [c for c in diagnosis.causes if c.group == leading.group is not None] or [leading]
    claimed.sort(key=lambda cause: -cause.probability)
    names = dict.fromkeys(name for cause in claimed for name in cause.effects)
    others = tuple(name for name in names if name != effect)
    outcome: Outcome = "another cause"
    if effect in names:
        outcome = "in a group" if others else "alone"
    return outcome, others, diagnosis.claim(leading)
