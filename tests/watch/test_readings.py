"""What one test by itself says of the watched quantities, against what is known of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from scipy import stats

from shm.assumptions import DEFAULTS
from shm.errors import BadInput
from shm.models import described
from shm.models.base import Conditions
from shm.values import (
    NAN,
    PLANES,
    AddedMass,
    FloatArray,
    ModalTest,
    Plane,
    Reading,
)
from shm.watch.quantities import coordinate_of
from shm.watch.readings import Reader
from tests.helpers.hangers import HANGER_3
from tests.helpers.modelled_tests import (
    ALLOWANCE,
    EVERYTHING,
    MODEL_ERROR,
    SD,
    WHEN,
    common_of,
    frequencies,
    measured,
    posterior,
)

SPRUNG = (1.1, 0.97, 7.0, 7.6, 8.6, 6.4)
STRING = replace(HANGER_3, second_moment_m4=1e-9 * HANGER_3.second_moment_m4)
"""A bar that is all tension: frequencies go as its root."""


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
        coordinate_of(each, common_of([named[name] for name in each.parameters]))
        for each in reader.quantities[1:]
    ]
    return np.array([np.log(theta[0] / SPRUNG[0]), *springs])


def distance(reading: Reading, truth: FloatArray) -> float:
    """Chi-square of a reading about the truth."""
    off = reading.mean - truth
    return float(off @ reading.information @ off)


def test_of_a_string_the_tension_goes_as_the_frequency_squared() -> None:
    theta = (1.1, 0.97)
    before = frequencies(theta, "beam1", STRING)
    string = Reader(posterior(theta, "beam1", STRING), [measured(before)], STRING)
    reading = string.reading(measured(0.93 * before), WHEN)
    assert reading.mean == pytest.approx([2 * np.log(0.93)], abs=2e-5)
    closed_form = len(EVERYTHING) / 4 / (SD**2 + ALLOWANCE**2)
    assert reading.information[0, 0] == pytest.approx(closed_form, rel=1e-3)


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


@pytest.mark.parametrize("theta", [changed(), changed(tension=0.9, transverse=-0.5)])
def test_noisy_tests_are_read_within_their_own_covariance(
    reader: Reader, theta: tuple[float, ...]
) -> None:
    frequency_hz, truth = frequencies(theta), coordinates(reader, theta)
    rng = np.random.default_rng(3)
    readings = [reader.reading(measured(frequency_hz, rng=rng), WHEN) for _ in range(200)]
    found = np.array([distance(each, truth) for each in readings])
    # Three quantities; the mean of 200 has a standard deviation of 0.17.
    assert found.mean() == pytest.approx(3.0, abs=0.6)
    assert stats.kstest(found, stats.chi2(3).cdf).pvalue > 0.01
    for reading in readings[:3]:
        assert np.linalg.eigvalsh(reading.information).min() > 0


def test_a_model_error_that_all_tests_share_cancels(reader: Reader) -> None:
    exact = frequencies(SPRUNG) / np.exp(MODEL_ERROR)
    without = Reader(posterior(SPRUNG), [measured(exact)], HANGER_3)
    theta = changed(tension=0.95, transverse=-0.3)
    now = frequencies(theta)
    one = reader.reading(measured(now), WHEN)
    other = without.reading(measured(now / np.exp(MODEL_ERROR)), WHEN)
    np.testing.assert_allclose(one.mean, other.mean, rtol=1e-6, atol=1e-9)
    biased = without.reading(measured(now), WHEN)
    assert distance(one, biased.mean) > 100


def test_the_residual_is_the_mean_over_the_tests_of_the_baseline() -> None:
    frequency_hz = frequencies(SPRUNG)
    tests = [measured(frequency_hz * (1 + off)) for off in (0.002, -0.002)]
    several = Reader(posterior(SPRUNG), tests, HANGER_3)
    reading = several.reading(measured(frequency_hz), WHEN)
    assert distance(reading, np.zeros(3)) < 1e-3
    blundered = [measured(frequency_hz), measured(frequency_hz * 1.01, sd=0.05)]
    weighted = Reader(posterior(SPRUNG), blundered, HANGER_3)
    assert distance(weighted.reading(measured(frequency_hz), WHEN), np.zeros(3)) < 1e-3


@pytest.mark.parametrize(
    "modes",
    [
        EVERYTHING[1:],
        [*EVERYTHING[:4], *EVERYTHING[6:9]],
        EVERYTHING[:6],
        [("transverse", 1), ("longitudinal", 2)],
    ],
)
def test_missing_modes_widen_a_reading_but_do_not_bias_it(
    reader: Reader, modes: list[tuple[Plane, int]]
) -> None:
    whole = reader.reading(measured(frequencies(SPRUNG)), WHEN)
    few = reader.reading(measured(frequencies(SPRUNG), modes), WHEN)
    np.testing.assert_allclose(few.mean, 0.0, atol=1e-6)
    assert np.linalg.eigvalsh(whole.information - few.information).min() > -1e-3
    theta = changed(tension=0.97)
    assert distance(reader.reading(measured(frequencies(theta), modes), WHEN), _of(theta)) < 0.05


def _of(theta: tuple[float, ...]) -> FloatArray:
    """Coordinates where the tension alone has changed."""
    return np.array([np.log(theta[0] / SPRUNG[0]), 0.0, 0.0])


def test_what_a_test_does_not_see_stays_at_nought_with_no_information(reader: Reader) -> None:
    one_plane = measured(frequencies(changed(tension=0.97)), EVERYTHING[:6])
    reading = reader.reading(one_plane, WHEN)
    longitudinal = [
        index for index, each in enumerate(reader.quantities) if each.plane == "longitudinal"
    ]
    assert len(longitudinal) == 1
    np.testing.assert_allclose(reading.mean[longitudinal], 0.0, atol=1e-9)
    np.testing.assert_allclose(reading.information[longitudinal], 0.0, atol=1e-3)
    assert reading.mean[0] == pytest.approx(np.log(0.97), abs=1e-3)


def test_modes_that_the_baseline_lacks_are_left_out() -> None:
    narrow = Reader(posterior(SPRUNG), [measured(frequencies(SPRUNG), EVERYTHING[:9])], HANGER_3)
    now = frequencies(changed(tension=0.95))
    few, many = (
        narrow.reading(measured(now, modes), WHEN) for modes in (EVERYTHING[:9], EVERYTHING)
    )
    sd = 1 / np.sqrt(np.diag(many.information))
    np.testing.assert_allclose(few.mean / sd, many.mean / sd, atol=1e-6)
    known = (each.information * np.outer(sd, sd) for each in (few, many))
    np.testing.assert_allclose(*known, atol=1e-6)


def test_an_irregular_mode_is_not_read() -> None:
    seen = measured(frequencies(SPRUNG))
    irregular = replace(seen, modes=(replace(seen.modes[0], irregular=True), *seen.modes[1:]))
    plain = Reader(posterior(SPRUNG), [irregular], HANGER_3)
    assert (seen.modes[0].plane, seen.modes[0].order) not in plain.modes
    assert len(plain.modes) == len(seen.modes) - 1


def test_a_test_without_a_common_mode_says_nothing() -> None:
    narrow = Reader(posterior(SPRUNG), [measured(frequencies(SPRUNG), EVERYTHING[:6])], HANGER_3)
    reading = narrow.reading(measured(frequencies(SPRUNG), EVERYTHING[6:]), WHEN)
    assert np.all(reading.information == 0)
    assert np.all(reading.mean == 0)
    assert np.all(narrow.reading(ModalTest("bare", ()), WHEN).information == 0)


def test_a_test_of_conditions_beyond_the_class_says_nothing(reader: Reader) -> None:
    off = measured(frequencies(SPRUNG), added_mass=AddedMass(25.0, 99.0))
    assert np.all(reader.reading(off, WHEN).information == 0)


def test_a_baseline_without_modes_is_refused() -> None:
    with pytest.raises(BadInput, match="no test with a mode"):
        Reader(posterior(SPRUNG), [ModalTest("bare", ())], HANGER_3)


def test_a_known_mass_of_one_test_is_no_change(reader: Reader) -> None:
    mass = AddedMass(25.0, 3.6)
    laden = frequencies(SPRUNG, conditions=Conditions(added_mass=mass))
    told = reader.reading(measured(laden, added_mass=mass), WHEN)
    assert distance(told, np.zeros(3)) < 1e-3
    untold = reader.reading(measured(laden), WHEN)
    assert distance(untold, np.zeros(3)) > 50


def test_an_adopted_swing_with_the_temperature_is_no_change() -> None:
    name = "beam1+temperature_tension@everywhere:reference_c=10"
    made = described(name, HANGER_3)
    values = dict.fromkeys(made.parameter_names, 0.0) | {"theta_F": 1.1}
    values["tension_per_kelvin_n_k"] = -1000.0
    theta = [values[each] for each in made.parameter_names]
    cold, warm = (
        frequencies(theta, name, conditions=Conditions(temperature_shift_k=shift))
        for shift in (0.0, 20.0)
    )
    known = replace(posterior(theta, name), samples=np.tile(theta, (10, 1)))
    adopted = Reader(known, [measured(cold, temperature_c=10.0)], HANGER_3)
    assert [each.name for each in adopted.quantities] == ["tension"]
    assert adopted.reading(measured(warm, temperature_c=30.0), WHEN).mean == pytest.approx(
        [0.0], abs=1e-9
    )
    swing = np.log(1 - 20 * 1000.0 / (1.1 * HANGER_3.nominal_tension_n))
    taken_as_cold = adopted.reading(measured(warm, temperature_c=10.0), WHEN)
    assert taken_as_cold.mean == pytest.approx([swing], rel=1e-3)
    unknown = adopted.reading(measured(warm), WHEN)
    assert np.all(unknown.information == 0)
    assert np.isnan(unknown.temperature_c)


def test_an_error_that_is_not_stated_is_the_assumed_one(reader: Reader) -> None:
    frequency_hz = frequencies(SPRUNG)
    unstated = measured(frequency_hz)
    unstated = replace(
        unstated, modes=tuple(replace(mode, frequency_sd_hz=NAN) for mode in unstated.modes)
    )
    sd = DEFAULTS.unstated_frequency_sd.value
    stated = reader.reading(measured(frequency_hz, sd=sd), WHEN)
    np.testing.assert_allclose(
        reader.reading(unstated, WHEN).information, stated.information, rtol=1e-6
    )


def test_the_allowance_bounds_what_a_perfect_test_tells() -> None:
    frequency_hz = frequencies(SPRUNG)
    coarse = Reader(posterior(SPRUNG), [measured(frequency_hz)], HANGER_3, frequency_allowance=2e-3)
    perfect, fair = (
        coarse.reading(measured(frequency_hz, sd=sd), WHEN).information[0, 0] for sd in (1e-9, 2e-3)
    )
    assert perfect == pytest.approx(2 * fair, rel=1e-6)


@pytest.mark.parametrize("factor", [0.2, 3.0])
def test_frequencies_of_no_such_hanger_say_next_to_nothing(reader: Reader, factor: float) -> None:
    reading = reader.reading(measured(factor * frequencies(SPRUNG)), WHEN)
    assert np.all(np.isfinite(reading.mean))
    steps = np.array([each.step_sd for each in reader.quantities])
    assert np.diag(reading.information) @ steps**2 < 1


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


@pytest.mark.parametrize(
    "theta",
    [
        changed(transverse=-0.5, longitudinal=-0.5),
        changed(transverse=-1.0, longitudinal=-1.0),
        changed(tension=0.9, transverse=-0.7),
        (*SPRUNG[:2], SPRUNG[2] - 0.7, *SPRUNG[3:]),
    ],
    ids=["springs", "springs by a decade", "tension and springs", "one spring alone"],
)
def test_a_mistaken_mode_is_found_though_the_springs_have_moved(
    reader: Reader, theta: tuple[float, ...]
) -> None:
    frequency_hz = frequencies(theta)
    good = reader.reading(measured(frequency_hz), WHEN)
    frequency_hz[0, 2] *= 1.04
    misled = reader.reading(measured(frequency_hz), WHEN)

    assert good.modes is not None
    assert misled.modes is not None
    assert not good.modes.mistaken.any()
    assert [reader.modes[n] for n in np.flatnonzero(misled.modes.mistaken)] == [(PLANES[0], 3)]


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


def test_mode_by_mode_a_reading_says_what_it_says_as_a_whole(reader: Reader) -> None:
    theta = changed(tension=0.95, longitudinal=-0.2)
    modes = [each for each in EVERYTHING if each != (PLANES[1], 4)]
    reading = reader.reading(measured(frequencies(theta), modes=modes, amplitude=1.5), WHEN)

    assert reading.modes is not None
    missing = [each == (PLANES[1], 4) for each in reader.modes]
    assert np.isinf(reading.modes.variances).tolist() == missing
    expected = reading.modes.slopes @ coordinates(reader, theta)
    assert reading.modes.values == pytest.approx(expected, abs=1e-5)
    weighted = reading.modes.slopes / reading.modes.variances[:, None]
    information = weighted.T @ reading.modes.slopes
    assert information == pytest.approx(reading.information, rel=1e-6, abs=1e-3)
    assert reading.amplitude == 1.5


def test_a_reading_carries_the_test_its_time_and_its_temperature(reader: Reader) -> None:
    other = datetime(2027, 1, 1, tzinfo=UTC)
    warm = reader.reading(measured(frequencies(SPRUNG), temperature_c=21.0), other)
    assert (warm.test, warm.time, warm.temperature_c) == ("t", other, 21.0)
    assert np.isnan(reader.reading(measured(frequencies(SPRUNG)), WHEN).temperature_c)


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


def test_a_test_without_a_temperature_says_what_a_kelvin_has_done_to_it() -> None:
    mild = measured(frequencies(SPRUNG), temperature_c=10.0)
    warm = replace(HANGER_3, elastic_modulus_pa=HANGER_3.elastic_modulus_pa * (1 - 20 * 3e-4))
    softer = frequencies(SPRUNG, hanger=warm)
    reader = Reader(posterior(SPRUNG), [mild], HANGER_3)
    known = reader.reading(measured(softer, temperature_c=30.0), WHEN)
    unknown = reader.reading(measured(softer), WHEN)
    assert known.per_kelvin is None
    assert unknown.per_kelvin is not None
    corrected = replace(unknown, mean=unknown.mean - 20 * unknown.per_kelvin)
    assert distance(corrected, np.zeros(3)) < 0.1 < distance(unknown, np.zeros(3)) / 20
