"""The gap diagnosis of a user's own simulator: closed form first, then three textbook systems."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from shm.errors import BadInput, UsageError
from shm.gap.hypotheses.contract import Hypothesis
from shm.gap.simulator.any_simulator import diagnose_simulator
from shm.gap.simulator.simulator_fit import fit_hypothesis as fitted
from shm.gap.simulator.simulator_problem import (
    Condition,
    Predict,
    Prior,
    Reading,
    Simulator,
    SimulatorEffect,
    SimulatorProblem,
)
from tests.helpers.slow import few_of
from tests.helpers.textbook_simulators import CANTILEVER, FRAME, OSCILLATOR
from tests.worlds.textbook_systems import cantilever, frame, oscillator


def line(p: dict[str, Any], at: Condition) -> Mapping[str, Any]:
    return {"y": p["slope"] * at["x"] + p.get("offset", 0.0)}


LINE = Simulator(
    line,
    {"slope": Prior("normal", 1.0, 0.5)},
    [SimulatorEffect("offset", {"offset": Prior("normal", 0.0, 1.0)}, line)],
)
READINGS = tuple(Reading({"x": x}, "y", 1.3 * x + 0.4, 0.1) for x in (0.0, 1.0, 2.0, 3.0))


def test_the_evidence_of_a_line_is_that_of_the_normal_distribution() -> None:
    """y = (1 + z/2) x + e: N(x, x x'/4 + sd^2 I), over three sizes of sd as mixed in the nodes."""
    problem = SimulatorProblem(LINE, READINGS)
    x, y = np.arange(4.0), problem.value
    log = []
    for node in problem.nodes():
        covariance = np.outer(x, x) / 4 + node.covariance.frequency
        away = y - x
        square = away @ np.linalg.solve(covariance, away)
        volume = np.linalg.slogdet(2 * np.pi * covariance)[1]
        log.append(node.log_weight - (square + volume) / 2)
    fit = fitted(problem, Hypothesis(), np.random.default_rng(1))
    assert fit.log_evidence == pytest.approx(np.logaddexp.reduce(log), abs=0.2)


def test_probabilities_add_to_one_and_the_summary_names_the_cause() -> None:
    """A scalar function gives what a vectorised one does."""
    candidates = [{"x": 0.0}, {"x": 1.7}]
    answer = diagnose_simulator(LINE, READINGS, candidates=candidates)
    assert sum(float(str(row["probability"])) for row in answer.to_records()) == pytest.approx(1)
    assert "offset" in answer.summary().splitlines()[0]
    assert answer.named == ("offset",)
    assert answer.shrinkage.held_out_after < answer.shrinkage.held_out_before
    assert answer.next_readings[0].condition == {"x": 0.0}  # where the slope alone can give nothing
    assert answer.causes[0].size["offset"][0] == pytest.approx(0.4, abs=0.2)
    other = diagnose_simulator(replace(LINE, vectorised=True), READINGS, candidates=candidates)
    assert other.summary() == answer.summary()


def test_without_stated_deviations_a_large_offset_is_found_all_the_same() -> None:
    noise = 0.01 * np.random.default_rng(2).standard_normal(12)
    readings = [Reading({"x": i / 3}, "y", 0.9 * i / 3 + 0.5 + e) for i, e in enumerate(noise)]
    assert diagnose_simulator(LINE, readings).named == ("offset",)


@pytest.mark.parametrize(
    ("simulator", "world", "true", "size"),
    few_of(
        [
            (FRAME, frame, "loose_joint", 3e-4),
            (CANTILEVER, cantilever, "support_moves", 2e-7),
            (OSCILLATOR, oscillator, "friction", 1.5),
        ],
        1,
    ),
    ids=["frame", "cantilever", "oscillator"],
)
def test_a_textbook_system_gives_up_its_cause(
    simulator: Simulator, world: Any, true: str, size: float
) -> None:
    """The truth is computed otherwise; with it off the catalogue, no other effect is blamed."""
    readings = [Reading(*each) for each in world(np.random.default_rng(3), size)]
    rivals = [each for each in simulator.effects if each.name != true]
    two = [each for each in simulator.effects if each.name == true] + rivals[:1]
    assert diagnose_simulator(replace(simulator, effects=two), readings).named == (true,)
    assert diagnose_simulator(replace(simulator, effects=rivals[-1:]), readings).named == ()


TWO_CAUSES = Simulator(
    lambda p, at: {"y": p["slope"] * at["x"] * (1 + p.get("warm", 0) * at["w"]) + p.get("off", 0)},
    {"slope": Prior("lognormal", 10.0, 0.2)},
    vectorised=True,
)


def two_causes(apart: bool, slip: float = 0.0) -> list[Reading]:
    """Of a line with an offset and a slope that grows with warmth, or with one slip instead."""
    rng = np.random.default_rng(1001)
    x, w = rng.permutation(np.linspace(0.1, 2, 12)), rng.uniform(0, 20, 12)
    y = 11 * x * (1 + apart * 0.005 * w) + apart * 0.8 + 0.1 * rng.standard_normal(12)
    y[7] += slip
    return [Reading({"x": float(x[i]), "w": float(w[i])}, "y", float(y[i]), 0.1) for i in range(12)]


@pytest.mark.parametrize("one_function", [True, False])
def test_two_causes_at_once_are_named_together_and_else_what_is_left_is_unknown(
    one_function: bool,
) -> None:
    """Whether both are one function of the user's or each has its own."""
    law = TWO_CAUSES.predict
    other = law if one_function else lambda p, at: law(p, at)
    warm = SimulatorEffect("warm", {"warm": Prior("uniform", -0.02, 0.02)}, law)
    off = SimulatorEffect("off", {"off": Prior("logarithmic", 0.05, 20.0)}, other)
    both = diagnose_simulator(replace(TWO_CAUSES, effects=[warm, off]), two_causes(True))
    assert set(both.named[0].split(" + ")) == {"warm", "off"}
    assert both.causes[0].probability < 0.96
    assert both.shrinkage.after < 1.5
    lacking = diagnose_simulator(replace(TWO_CAUSES, effects=[warm]), two_causes(True))
    assert lacking.named == ()
    assert lacking.unexplained_probability > 0.9


def test_one_slip_and_copies_are_remarked() -> None:
    answer = diagnose_simulator(TWO_CAUSES, two_causes(False, slip=1.0) * 3)
    assert "24 of 36 readings repeat" in answer.remarks[0]
    assert len(answer.gaps) == 12
    at = dict(two_causes(False)[7].condition)
    assert f"at {at} lies" in answer.remarks[1]
    assert diagnose_simulator(TWO_CAUSES, two_causes(False)).remarks == ()


def test_a_parameter_at_its_bound_has_no_spread_and_a_remark() -> None:
    narrow = replace(LINE, parameters={"slope": Prior("uniform", 0.5, 1.0)}, effects=())
    answer = diagnose_simulator(narrow, [replace(each, sd=0.02) for each in READINGS])
    assert "slope lies at its bound, 0.999" in answer.remarks[0]
    assert "± unknown alone" in answer.summary()


@pytest.mark.parametrize("vectorised", [True, False])
@pytest.mark.parametrize(
    ("predict", "said"),
    [
        (lambda p, at: {"y": at["nothing"]}, "effect offset fails.* slope = .*KeyError"),
        (lambda p, at: {"y": 1j * p["slope"]}, "effect offset predicts 'y' as complex"),
        (lambda p, at: {"y": "3"}, "effect offset predicts 'y' as .*not as real numbers"),
    ],
)
def test_an_effect_that_fails_is_named(predict: Predict, said: str, vectorised: bool) -> None:
    broken = [replace(LINE.effects[0], predict=predict)]
    with pytest.raises(UsageError, match=said):
        diagnose_simulator(replace(LINE, effects=broken, vectorised=vectorised), READINGS)


@pytest.mark.parametrize(
    ("predict", "vectorised", "refused", "said"),
    [
        (lambda p, at: p["slope"] * at["x"], True, UsageError, "not observables by their names"),
        (lambda p, at: {"y": math.exp(p["slope"])}, True, UsageError, "out vectorised=True"),
        (lambda p, at: {"y": np.zeros(3)}, True, UsageError, "one number for each set"),
        (lambda p, at: {"y": np.nan * p["slope"]}, False, BadInput,
         "no prediction of the simulator is finite"),
    ],
)  # fmt: skip
def test_a_function_without_numbers_is_refused_with_a_remedy(
    predict: Predict, vectorised: bool, refused: type[Exception], said: str
) -> None:
    with pytest.raises(refused, match=said):
        diagnose_simulator(replace(LINE, predict=predict, vectorised=vectorised), READINGS)


@pytest.mark.parametrize(
    ("ask", "said"),
    [
        (lambda: Prior("logarithmic", -1.0, 1.0), "cannot be"),
        (lambda: replace(LINE, effects=[SimulatorEffect("turned", LINE.parameters, line)]),
         "Named twice in a simulator: slope"),
        (lambda: replace(LINE, effects=[SimulatorEffect("same", {}, line)]),
         "effect same has no parameters"),
        (lambda: diagnose_simulator(LINE, [*READINGS, Reading({"x": 1.0}, "z", 1.0, 0.1)]),
         "predicts no 'z'"),
        (lambda: diagnose_simulator(LINE, READINGS[:1]), "too few"),
        (lambda: diagnose_simulator(LINE, READINGS, seed=-1), "seed is -1"),
        (lambda: Reading({}, "y", "1"), "a reading holds '1', which is no number"),  # type: ignore[arg-type]
        (lambda: Prior("normal", 0.0, "1"), "a prior holds '1'"),  # type: ignore[arg-type]
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_with_a_remedy(ask: Callable[[], object], said: str) -> None:
    with pytest.raises(UsageError, match=said):
        ask()


@pytest.mark.parametrize("other", [(), (Reading({"x": 1.0}, "z", 2.0),)])
def test_diagnose_simulator_all_zero(other: tuple[Reading, ...]) -> None:
    zeros = tuple(Reading({"x": x}, "y", 0.0) for x in (0.0, 1.0, 2.0))
    with pytest.raises(BadInput, match=r"All readings of y are 0.*Give `sd`"):
        diagnose_simulator(LINE, (*other, *zeros))


def test_diagnose_simulator_zero_with_sd() -> None:
    zeros = tuple(Reading({"x": x}, "y", 0.0, 0.1) for x in (0.0, 1.0, 2.0))
    mean, _ = diagnose_simulator(LINE, zeros).parameters_after["slope"]
    assert abs(mean) < 0.2
