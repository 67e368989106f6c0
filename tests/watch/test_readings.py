"""What one test by itself says of the watched quantities, against what is known of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from shm.errors import BadInput
from shm.models import described
from shm.values import (
    PLANES,
    AddedMass,
    FloatArray,
    ModalTest,
    Reading,
)
from shm.watch.engine.readings import Reader
from tests.helpers.hangers import HANGER_3
from tests.helpers.modelled_tests import (
    EVERYTHING,
    WHEN,
    common_of,
    frequencies,
    measured,
    posterior,
)

SPRUNG = (1.1, 0.97, 7.0, 7.6, 8.6, 6.4)


@pytest.fixture(scope="module")
def reader() -> Reader:
    return Reader(posterior(SPRUNG), [measured(frequencies(SPRUNG))], HANGER_3)


def changed(
    tension: float = 1.0, transverse: float = 0.0, longitudinal: float = 0.0
) -> tuple[float, ...]:
    """The baseline with its tension multiplied and decades added to both ends of its planes."""
    springs = [
        value + decades
        for value, decades in zip(SPRUNG[2:], (transverse, longitudinal) * 2, strict=True)
    ]
    return (SPRUNG[0] * tension, SPRUNG[1], *springs)


def coordinates(reader: Reader, theta: Sequence[float]) -> FloatArray:
    """Where the state `theta` of beam2 lies in the reader's coordinates (q,)."""
    named = dict(zip(described("beam2", HANGER_3).parameter_names, theta, strict=True))
    springs = [
        np.interp(
            common_of([named[name] for name in each.parameters]), each.values, each.coordinates
        )
        for each in reader.quantities[1:]
    ]
    return np.array([np.log(theta[0] / SPRUNG[0]), *springs])


def distance(reading: Reading, truth: FloatArray) -> float:
    """Chi-square of a reading about the truth."""
    off = reading.mean - truth
    return float(off @ reading.information @ off)


@pytest.mark.parametrize(
    "theta",
    [
        changed(),
        changed(tension=0.9),
        changed(tension=1.1),
        changed(transverse=-0.5),
        changed(transverse=0.5),
        changed(longitudinal=-0.5),
        changed(tension=0.9, transverse=-0.5),
        changed(tension=1.1, longitudinal=-0.5),
        changed(tension=0.9, transverse=-0.5, longitudinal=0.5),
        changed(tension=0.7, longitudinal=-1.2),
    ],
)
def test_what_has_changed_is_read_without_bias(reader: Reader, theta: tuple[float, ...]) -> None:
    reading = reader.reading(measured(frequencies(theta)), WHEN)
    truth = coordinates(reader, theta)
    assert distance(reading, truth) < 0.01
    assert reading.mean[0] == pytest.approx(truth[0], abs=2e-4)
    assert reading.modes is not None
    assert reading.modes.values == pytest.approx(reader.columns.slopes @ truth, abs=3e-4)


def test_a_test_of_conditions_beyond_the_class_says_nothing(reader: Reader) -> None:
    off = measured(frequencies(SPRUNG), added_mass=AddedMass(25.0, 99.0))
    assert np.all(reader.reading(off, WHEN).information == 0)


def test_a_baseline_without_modes_is_refused() -> None:
    with pytest.raises(BadInput, match="no test with a mode"):
        Reader(posterior(SPRUNG), [ModalTest("bare", ())], HANGER_3)


@pytest.mark.parametrize("theta", [SPRUNG, changed(tension=0.9), changed(tension=1.05)])
def test_a_mode_taken_for_another_is_left_out_and_moves_nothing(
    reader: Reader, theta: tuple[float, ...]
) -> None:
    frequency_hz, truth = frequencies(theta), coordinates(reader, theta)
    good = reader.reading(measured(frequency_hz), WHEN)
    frequency_hz[0, 2] = frequency_hz[0, 3]
    misled = reader.reading(measured(frequency_hz), WHEN)
    without = [each for each in EVERYTHING if each != (PLANES[0], 3)]
    lacking = reader.reading(measured(frequency_hz, modes=without), WHEN)

    assert good.modes is not None
    assert misled.modes is not None
    assert lacking.modes is not None
    assert not good.modes.mistaken.any()
    assert [reader.modes[n] for n in np.flatnonzero(misled.modes.mistaken)] == [(PLANES[0], 3)]
    assert distance(misled, truth) < 0.01
    assert misled.mean == pytest.approx(lacking.mean)
    assert misled.information == pytest.approx(lacking.information)
    assert misled.modes.variances == pytest.approx(lacking.modes.variances)


@pytest.mark.parametrize("left", [0.3, 0.05, 0.03])
@pytest.mark.parametrize("stiffness", [1.0, 6.0, 30.0])
def test_a_slack_hanger_is_read_as_slack(left: float, stiffness: float) -> None:
    """Thick bars, too, whose frequencies hang on their ends more than on the tension."""
    thick = replace(HANGER_3, second_moment_m4=stiffness * HANGER_3.second_moment_m4)
    theta = (1.0, 1.0, 7.0, 7.6, 8.6, 6.4)
    baseline = frequencies(theta, "beam2", thick)
    own = Reader(posterior(theta, "beam2", thick), [measured(baseline)], thick)
    slack = frequencies((left, *theta[1:]), "beam2", thick)
    reading = own.reading(measured(slack), WHEN)

    assert reading.modes is not None
    assert not reading.modes.mistaken.any()
    assert np.exp(reading.mean[0]) == pytest.approx(left, abs=0.05)


def test_where_most_modes_fit_no_state_the_test_says_little(reader: Reader) -> None:
    frequency_hz = frequencies(SPRUNG)
    wild = frequency_hz * np.exp(np.random.default_rng(3).normal(0, 0.1, frequency_hz.shape))
    misled = reader.reading(measured(wild), WHEN)
    good = reader.reading(measured(frequency_hz), WHEN)
    assert misled.information[0, 0] < good.information[0, 0] / 1000


def test_steel_that_softens_as_it_warms_is_no_change() -> None:
    """Twenty kelvin warmer its modulus is 0.6 % lower: tension and ends are what they were."""
    mild = measured(frequencies(SPRUNG), temperature_c=10.0)
    warm = replace(HANGER_3, elastic_modulus_pa=HANGER_3.elastic_modulus_pa * (1 - 20 * 3e-4))
    softer = frequencies(SPRUNG, hanger=warm)
    told = Reader(posterior(SPRUNG), [mild], HANGER_3)
    known = told.reading(measured(softer, temperature_c=30.0), WHEN)
    unknown = told.reading(measured(softer), WHEN)
    nothing = np.zeros(3)
    assert distance(known, nothing) < 0.05
    assert distance(unknown, nothing) > 20 * distance(known, nothing)
