"""A user's own simulator as the gap diagnosis sees it: priors, predictions, errors of readings.

    y_i = f(theta, condition_i)[observable_i] + e_i,    theta_j = prior_j(z_j),  z ~ N(0, 1)

Every prior is a map of a standard normal z, as in the diagnosis of hangers, and the errors e are a
few possibilities of unknown size (`NoiseNode`), so that `shm.inference.sampler.likelihood` serves
both. What is the measurement's own (a gain, an offset) is a parameter of the simulator: it is in
every hypothesis and competes with none.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias

import numpy as np
import scipy

from shm.assumptions import DEFAULTS
from shm.errors import BadInput, UsageError
from shm.gap.hypotheses.contract import Hypothesis
from shm.inference.sampler.likelihood import Covariance, Likelihood, NoiseNode
from shm.values import BoolArray, FloatArray, IntArray

Condition: TypeAlias = Mapping[str, float]
Predict: TypeAlias = Callable[[dict[str, Any], Condition], Mapping[str, Any]]

# Gauss and Hermite's three points of a standard normal distribution.
_HERMITE = ((-(3**0.5), 1 / 6), (0.0, 2 / 3), (3**0.5, 1 / 6))
_UNKNOWN_SDS = 20  # technical: steps of a third in the logarithm of an unknown standard deviation
# Judgement: what is off by more than half its own size is seen without a diagnosis.
LARGEST_REMAINDER = 0.5
_REMAINDERS = 8  # technical: from one standard deviation to a half of the value, factors of 2 to 3
# Judgement: causes act alike at conditions that are less than a third of their range apart.
_SMOOTH = 1 / 3
_SEVERAL = 6  # technical: of more observables, a remainder is not tried in each one alone


@dataclass(frozen=True)
class Prior:
    """Describe what is known of a parameter before the data, as one of four spreads.

    `uniform` and `logarithmic` lie between `a` and `b`; `normal` has the mean `a` and the standard
    deviation `b`; `lognormal` has the median `a`, and its logarithm the standard deviation `b`.
    """

    spread: Literal["uniform", "logarithmic", "normal", "lognormal"]
    a: float
    b: float

    def __post_init__(self) -> None:
        _check_numbers("a prior", self.a, self.b)
        rises = self.a < self.b if self.spread in ("uniform", "logarithmic") else self.b > 0
        positive = self.a > 0 or self.spread in ("uniform", "normal")
        if not (rises and positive):
            raise UsageError(
                f"Prior({self.spread!r}, {self.a:g}, {self.b:g}) cannot be.",
                remedy="Bounds rise, deviations are above 0, logarithms need positive numbers.",
            )

    def value(self, z: FloatArray) -> FloatArray:
        """Return the parameter at standard normal coordinates of any shape."""
        match self.spread:
            case "uniform":
                return np.asarray(self.a + (self.b - self.a) * scipy.special.ndtr(z))
            case "logarithmic":
                return np.asarray(self.a * (self.b / self.a) ** scipy.special.ndtr(z))
            case "normal":
                return np.asarray(self.a + self.b * z)
            case "lognormal":
                return np.asarray(self.a * np.exp(self.b * z))


@dataclass(frozen=True)
class Reading:
    """One measured `observable` under a `condition`; an unknown `sd` is NaN."""

    condition: Condition
    observable: str
    value: float
    sd: float = float("nan")

    def __post_init__(self) -> None:
        _check_numbers("a reading", self.value, self.sd, *self.condition.values())


@dataclass(frozen=True)
class SimulatorEffect:
    """Describe what may be true beside the simulator: its priors and the simulator with it in.

    `predict` gets the simulator's parameters and the effect's own in one dictionary.
    """

    name: str
    parameters: Mapping[str, Prior]
    predict: Predict


@dataclass(frozen=True)
class Simulator:
    """The model under test: `predict(parameters, condition)` gives observables by name.

    Where it is `vectorised`, parameters come as arrays (n,) and observables are arrays (n,).
    """

    predict: Predict
    parameters: Mapping[str, Prior]
    effects: Sequence[SimulatorEffect] = ()
    vectorised: bool = False

    def __post_init__(self) -> None:
        names = [each.name for each in self.effects]
        twice = sorted({name for name in names if names.count(name) > 1})
        for each in self.effects:
            twice += sorted(set(each.parameters) & set(self.parameters))
            if not each.parameters:
                raise UsageError(
                    f"effect {each.name} has no parameters.",
                    remedy="Give its size a prior; what has none belongs in the simulator.",
                )
        if twice:
            raise UsageError(
                f"Named twice in a simulator: {', '.join(twice)}.",
                remedy="Each effect, and each parameter beside the simulator's, has its own name.",
            )


@dataclass(frozen=True, eq=False)
class SimulatorProblem:
    """A simulator and its readings: `value` and `sd` (data,), `scale` (data,) of the observable.

    The scale is the root mean square of an observable's readings unless it is known.
    """

    simulator: Simulator
    readings: tuple[Reading, ...]
    scale: FloatArray = field(default_factory=lambda: np.empty(0))
    value: FloatArray = field(init=False)
    sd: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        value = np.array([each.value for each in self.readings], dtype=float)
        sd = np.array([each.sd for each in self.readings], dtype=float)
        if len(value) < 2 or not np.isfinite(value).all() or (sd <= 0).any():
            raise UsageError(
                "Readings are too few, not finite, or have a standard deviation of 0 or less.",
                remedy="Give two and more; leave out what is unknown; an unknown sd is NaN.",
            )
        same = self.same_observable
        object.__setattr__(self, "value", value)
        object.__setattr__(self, "sd", sd)
        if not len(self.scale):
            object.__setattr__(self, "scale", np.sqrt(same @ value**2 / same.sum(axis=1)))
        for reading in self.readings:
            if np.isnan(reading.sd) and not self.scale[self._indices_of(reading.observable)].any():
                raise BadInput(
                    f"All readings of {reading.observable} are 0 and have no standard deviation: "
                    "how large an error could be is unknown.",
                    remedy="Give `sd` to each reading, or check what was recorded.",
                )

    def _indices_of(self, observable: str) -> list[int]:
        return [i for i, each in enumerate(self.readings) if each.observable == observable]

    @property
    def same_observable(self) -> FloatArray:
        """Return 1 where two readings are of one observable (data, data)."""
        names = np.array([each.observable for each in self.readings])
        return np.asarray(names[:, None] == names, dtype=float)

    def effects(self, hypothesis: Hypothesis) -> tuple[SimulatorEffect, ...]:
        """Return the effects of a hypothesis; none of the simulator alone."""
        return tuple(e for e in self.simulator.effects if e.name in hypothesis.names)

    def effect_priors(self, hypothesis: Hypothesis) -> dict[str, Prior]:
        """Return the priors of its effects alone."""
        return {n: p for each in self.effects(hypothesis) for n, p in each.parameters.items()}

    def priors(self, hypothesis: Hypothesis) -> dict[str, Prior]:
        """Return those of the simulator, then of the effects: a coordinate z each, in order."""
        return {**self.simulator.parameters, **self.effect_priors(hypothesis)}

    def dimension(self, hypothesis: Hypothesis) -> int:
        return len(self.priors(hypothesis))

    def linear(self, hypothesis: Hypothesis) -> IntArray:
        """Return no column: nobody knows in which the simulator is linear."""
        return np.empty(0, dtype=np.int64)

    def likelihood(self, hypothesis: Hypothesis) -> Likelihood:
        return Likelihood(self.flexible_nodes() if hypothesis.flexible else self.nodes())

    def part(self, rows: BoolArray) -> SimulatorProblem:
        """Return the problem of some of the readings (data,)."""
        chosen = [each for each, keep in zip(self.readings, rows, strict=True) if keep]
        return SimulatorProblem(self.simulator, tuple(chosen), self.scale[rows])

    def predict(self, hypothesis: Hypothesis, z: FloatArray) -> FloatArray:
        """Return predictions (n, data) at z (n, d)."""
        return self.predicted_of(hypothesis, z, self.readings)

    def predicted_of(
        self, hypothesis: Hypothesis, z: FloatArray, readings: Sequence[Reading]
    ) -> FloatArray:
        """Return predictions (n, readings) at z (n, d), be they measured or only planned.

        Two effects that are one function act together in it; others add what each does alone.
        """
        effects = self.effects(hypothesis)
        priors = self.priors(hypothesis)
        theta = {name: prior.value(z[:, j]) for j, (name, prior) in enumerate(priors.items())}
        if len({each.predict for each in effects}) < 2:
            return self._predicted_by(next(iter(effects), None), theta, readings, len(z))
        alone = self._predicted_by(None, self._part(theta), readings, len(z))
        each = [self._predicted_by(e, self._part(theta, e), readings, len(z)) for e in effects]
        return np.asarray(sum(each) - (len(each) - 1) * alone)

    def _part(
        self, theta: dict[str, FloatArray], effect: SimulatorEffect | None = None
    ) -> dict[str, FloatArray]:
        names = {*self.simulator.parameters, *(effect.parameters if effect else ())}
        return {name: values for name, values in theta.items() if name in names}

    def _predicted_by(
        self,
        effect: SimulatorEffect | None,
        theta: dict[str, FloatArray],
        readings: Sequence[Reading],
        count: int,
    ) -> FloatArray:
        predict = effect.predict if effect else self.simulator.predict
        rows: dict[tuple[tuple[str, float], ...], list[int]] = {}
        for i, each in enumerate(readings):
            rows.setdefault(tuple(sorted(each.condition.items())), []).append(i)
        predicted = np.empty((count, len(readings)))
        for key, members in rows.items():
            found = self._called(predict, theta, dict(key), _named(effect), count)
            for i in members:
                predicted[:, i] = _observable(found, readings[i], effect, count)
        if count and not np.isfinite(predicted).any():
            raise BadInput(
                f"no prediction of {_named(effect)} is finite.",
                remedy="Let it return numbers for all that its priors allow.",
            )
        return predicted

    def _called(
        self,
        predict: Predict,
        theta: dict[str, FloatArray],
        condition: Condition,
        of: str,
        count: int,
    ) -> Mapping[str, Any]:
        if self.simulator.vectorised:
            return _mapping(predict, dict(theta), condition, of)
        each = [
            _mapping(predict, {n: float(v[row]) for n, v in theta.items()}, condition, of)
            for row in range(count)
        ]
        return {name: _together([one.get(name) for one in each]) for name in each[0]}

    def nodes(self) -> tuple[NoiseNode, ...]:
        """Return unknown errors: stated ones times a common factor, unstated ones by a share."""
        known = np.isfinite(self.sd)
        bounds, spread = DEFAULTS.unstated_frequency_sd.bounds, DEFAULTS.stated_sd_log_sd.value
        shares = np.zeros(1) if known.all() else np.geomspace(*bounds, _UNKNOWN_SDS)
        factors = _HERMITE if known.any() else ((0.0, 1.0),)
        return tuple(
            _node(np.diag(reading_sd**2), np.log(weight / len(shares)))
            for share in shares
            for away, weight in factors
            for reading_sd in [np.where(known, np.exp(spread * away) * self.sd, share * self.scale)]
        )

    def flexible_nodes(self) -> tuple[NoiseNode, ...]:
        """Return the unknown errors and a remainder free in form and size, log-uniform in size."""
        plain = self.nodes()
        covariance = plain[len(plain) // 2].covariance.frequency
        sd = np.sqrt(np.diag(covariance))
        largest = np.maximum(LARGEST_REMAINDER * self.scale, 2 * sd)
        patterns, steps = self._patterns(), np.linspace(0, 1, _REMAINDERS)
        log_weight = -np.log(len(patterns) * len(steps))
        amplitudes = [sd ** (1 - step) * largest**step for step in steps]
        return tuple(
            _node(covariance + np.outer(size, size) * pattern, log_weight)
            for pattern in patterns
            for size in amplitudes
        )

    def _patterns(self) -> list[FloatArray]:
        """Return correlations (data, data) of a remainder: in all observables, and in each."""
        same = self.same_observable
        varied = self._varied_conditions()
        apart = sum(((each[:, None] - each) ** 2 for each in varied), np.zeros_like(same))
        forms = [np.eye(len(same)), same]
        if varied:
            forms.append(same * np.exp(-apart / (2 * _SMOOTH**2)))
        forms += [same * np.outer(each, each) for each in varied]
        observables = np.unique(same, axis=0)
        if 1 < len(observables) <= _SEVERAL:
            forms += [form * np.outer(one, one) for form in list(forms) for one in observables]
        return forms

    def _varied_conditions(self) -> list[FloatArray]:
        """Return each quantity that all conditions state and that varies, from 0 to 1."""
        stated = set.intersection(*(set(each.condition) for each in self.readings))
        values = [np.array([each.condition[n] for each in self.readings]) for n in sorted(stated)]
        return [(each - each.min()) / np.ptp(each) for each in values if np.ptp(each) > 0]


def _check_numbers(what: str, *given: object) -> None:
    """Raise UsageError if one of `given` is no real number."""
    for each in given:
        if np.asarray(each).dtype.kind not in "biuf":
            raise UsageError(
                f"{what} holds {each!r}, which is no number.",
                remedy="Write numbers without quotes; an unknown sd is NaN.",
            )


def _node(covariance: FloatArray, log_weight: float) -> NoiseNode:
    return NoiseNode(Covariance(covariance, np.empty(0), np.empty((0, 0))), float(log_weight), 0.0)


def _named(effect: SimulatorEffect | None) -> str:
    return f"effect {effect.name}" if effect else "the simulator"


def _mapping(
    predict: Predict, theta: dict[str, Any], condition: Condition, of: str
) -> Mapping[str, Any]:
    try:
        found: object = predict(theta, condition)
    except Exception as error:
        arrays = any(isinstance(each, np.ndarray) for each in theta.values())
        first = ", ".join(f"{n} = {float(np.ravel(v)[0]):.5g}" for n, v in theta.items())
        otherwise = ", or leave out vectorised=True" if arrays else ""
        raise UsageError(
            f"{of} fails{' on arrays that begin' if arrays else ''} with {first} under "
            f"{dict(condition)}: {type(error).__name__}: {error}.",
            remedy=f"Let it return numbers for all that its priors allow{otherwise}.",
        ) from error
    if not isinstance(found, Mapping):
        raise UsageError(
            f"{of} returned {type(found).__name__}, not observables by their names.",
            remedy='Return a dictionary, such as {"force_n": value}.',
        )
    return found


def _together(values: list[Any]) -> Any:
    """Return one array; what has no common shape is no number."""
    same_shape = len({np.shape(each) for each in values}) == 1
    return np.array(values) if same_shape else np.full(len(values), None)


def _observable(
    found: Mapping[str, Any], reading: Reading, effect: SimulatorEffect | None, count: int
) -> FloatArray:
    if reading.observable not in found:
        raise UsageError(
            f"{_named(effect)} predicts no {reading.observable!r} at {dict(reading.condition)}.",
            remedy=f"It gives {', '.join(found)}: return every observable that was read.",
        )
    values = np.asarray(found[reading.observable])
    if values.dtype.kind not in "biuf":
        raise UsageError(
            f"{_named(effect)} predicts {reading.observable!r} as {values.dtype}, not as real "
            "numbers.",
            remedy="Return floats: the size of what is complex, a number for a text.",
        )
    if values.shape not in ((), (count,)):
        raise UsageError(
            f"{reading.observable!r} came with shape {values.shape}, of {count} parameter sets.",
            remedy="Return one number for each set, in their order.",
        )
    return values.astype(float)
