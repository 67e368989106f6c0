"""Every registered model class keeps the contract; hanger 3 gives the thesis's clamped beam."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from shm.errors import UsageError
from shm.models import MODELS, PRIORS, THESIS, AsMade, Model, build
from tests.helpers.hangers import HANGER_3, ROD

# Each makes a reduced basis of its own: s1 stands for what `AsMade` adds to a solid class.
MADE_ALIKE = [(name, "description") for name in ("s2", "solid0", "solid1", "solid2")]
_SLOW = [(name, "thesis") for name in ("s2", "solid0", "solid1", "solid2")]


@pytest.fixture(
    params=[
        pytest.param(
            each,
            marks=[pytest.mark.trial] * (each in MADE_ALIKE) + [pytest.mark.slow] * (each in _SLOW),
        )
        for each in product(MODELS, PRIORS)
    ],
    ids=" ".join,
)
def model(request: pytest.FixtureRequest) -> Model:
    name, priors = request.param
    return build(name, HANGER_3, priors)


@pytest.fixture
def theta(model: Model) -> np.ndarray:
    prior = model.prior
    rng = np.random.default_rng(1)
    return rng.uniform(prior.lower, prior.upper, (20, len(prior.names)))


def sags(model: Model) -> bool:
    """Return True for a class with own weight, which a reduced basis solves."""
    return isinstance(model, AsMade) and model.has_terms


def test_frequencies_rise_with_the_order_and_the_tension(model, theta) -> None:
    more = theta.copy()
    more[:, model.parameter_names.index("theta_F")] *= 1.1
    tighter, slacker = (model.frequencies_hz(each, 6) for each in (more, theta))
    assert slacker.shape == (20, 2, 6)
    assert np.all(np.diff(slacker, axis=2) > 0)
    # In the longitudinal plane of one with own weight, sag stiffens a slack bar.
    planes = slice(0, 1 if sags(model) else 2)
    assert np.all(tighter[:, planes] > slacker[:, planes])


def test_a_swap_changes_no_frequency(model, theta, monkeypatch) -> None:
    monkeypatch.setattr("shm.models.one_hanger.hanger_model.GRAVITY_M_S2", 0.0)
    for one, other in model.swaps:
        swapped = theta.copy()
        columns = [model.parameter_names.index(name) for name in (one, other)]
        swapped[:, columns] = theta[:, columns[::-1]]
        np.testing.assert_allclose(
            model.frequencies_hz(swapped, 6),
            model.frequencies_hz(theta, 6),
            rtol=1e-6 if sags(model) else 1e-13,
        )


def test_shapes_reach_one_and_vanish_at_ends_that_are_held(model, theta) -> None:
    x = np.linspace(0, model.stiffness_mass_length(theta[:1])[2][0] * HANGER_3.length_m, 501)
    for plane in ("transverse", "longitudinal"):
        shape = model.shape(theta[0], plane, 2, x)
        assert np.abs(shape).max() == pytest.approx(1, abs=1e-3)
        if model.name != "solid1":
            np.testing.assert_allclose(shape[[0, -1]], 0, atol=1e-9)


def test_a_stiffer_end_spring_is_told_in_newton_metres_and_raises_a_frequency(model, theta) -> None:
    deck, arch = model.springs_n_m_rad(theta)
    stiffer = theta.copy()
    for column, name in enumerate(model.parameter_names):
        stiffer[:, column] += np.log10(2) * name.startswith("log10_k")
    springs = np.concatenate([deck, arch])
    doubled = np.concatenate(model.springs_n_m_rad(stiffer))
    np.testing.assert_allclose(doubled, 2 * springs)
    assert np.all(model.frequencies_hz(stiffer, 3) >= model.frequencies_hz(theta, 3))
    has_springs = any(name.startswith("log10_k") for name in model.parameter_names)
    assert np.isinf(springs).all() == (not has_springs)


def test_named_values_are_packed_in_order_and_wrong_names_are_refused(model) -> None:
    values = {name: float(i) for i, name in enumerate(model.parameter_names)}
    np.testing.assert_array_equal(model.pack(values), np.arange(len(values)))
    with pytest.raises(UsageError, match="unknown"):
        model.pack({**values, "theta_X": 1.0})
    with pytest.raises(UsageError, match="missing"):
        model.pack({})


def test_beam_1_of_hanger_3_gives_the_exact_first_frequency() -> None:
    """5.58 Hz at 12 m, 7.67 Hz at 9.817 m; the thesis prints 5.64 and 7.70 (ERRATA)."""
    model = build("beam1", HANGER_3, THESIS)
    long, short = model.frequencies_hz(np.array([[1.0, 1.0], [1.0, 9.817 / 12]]), 1)[:, 0, 0]
    assert long == pytest.approx(5.58, abs=0.005)
    assert short == pytest.approx(7.67, abs=0.005)


def test_an_end_spring_is_stiff_against_bending_stiffness_times_wave_number() -> None:
    """sqrt(EI T + (EI n pi / L)^2): of a string EI and T alone, of a beam EI and n pi / L."""
    ei, tension = ROD.bending_stiffness_n_m2, ROD.nominal_tension_n
    for order in (1, 4):
        expected = np.sqrt(ei * tension + (ei * order * np.pi / ROD.length_m) ** 2)
        for one in (build("beam1", ROD), build("beam1", ROD, THESIS)):
            assert one.wave_stiffness_n_m_rad(order) == pytest.approx(expected, rel=1e-12)
