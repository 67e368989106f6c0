"""Mode shapes as data: what they say, what they forgive, and which ends they tell apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.inference.answer.updating import update
from shm.inference.options import UpdateOptions
from shm.inference.problem.shapes import MeasuredShapes, swaps_of
from shm.inference.sampler.likelihood import Covariance, Likelihood, NoiseNode
from shm.models import AsMade
from shm.values import PLANES, AddedMass, FloatArray, ModalTest, Mode, ShapePoint
from tests.helpers.classes_as_made import as_made
from tests.helpers.hangers import ROD

PLACES_M = (0.9, 1.9, 3.3)


def truth(model: AsMade, **values: float) -> FloatArray:
    """Return a parameter set (1, parameters): soft at the deck, stiff at the arch."""
    known = {"theta_F": 1.1, "theta_L": 1.0, "log10_k1": 4.0, "log10_k2": 4.0}
    known |= {"log10_k3": 7.0, "log10_k4": 7.0, **values}
    return model.pack(
        {n: known.get(n, model.usual(n) if n in model.terms else 0.0) for n in model.bounds}
    )[None]


def measured(model: AsMade, theta: FloatArray, places_m: tuple[float, ...] = PLACES_M) -> ModalTest:
    """Return a test with the exact frequencies and shapes of a parameter set."""
    hz = model.frequencies_hz(theta, 4)[0]
    shapes = model.shapes(theta, 4, np.array(PLACES_M))[0]
    modes = tuple(
        Mode(
            plane,
            order,
            float(hz[at, order - 1]),
            float(5e-4 * hz[at, order - 1]),
            shape=tuple(
                ShapePoint(x_m, float(value), sd=0.005 * float(np.abs(shapes[at]).max()))
                for x_m, value in zip(places_m, shapes[at, order - 1], strict=True)
            ),
        )
        for at, plane in enumerate(PLANES)
        for order in range(1, 5)
    )
    return ModalTest("a", modes)


def test_the_true_bar_fits_whatever_the_size_and_sign_of_its_shapes() -> None:
    model = as_made("beam2", ROD)
    theta = truth(model)
    test = measured(model, theta)
    turned = replace(
        test,
        modes=tuple(
            replace(m, shape=tuple(replace(p, value=-3 * p.value, sd=3 * p.sd) for p in m.shape))
            for m in test.modes
        ),
    )
    for each in (test, turned):
        shapes = MeasuredShapes([each], ROD)
        assert shapes.size == 8 * (len(PLACES_M) - 1)
        np.testing.assert_allclose(shapes.misfits(model, theta), 0, atol=1e-9)
    other = MeasuredShapes([test], ROD).misfits(model, truth(model, log10_k1=7.0, log10_k3=4.0))
    assert np.abs(other).max() > 5


def log_likelihood(shapes: MeasuredShapes, misfits: FloatArray) -> FloatArray:
    """Return that of misfits (n, size) by all factors of the stated errors."""
    own = np.eye(shapes.size)
    nodes = [
        NoiseNode(Covariance.of_frequencies(phi**2 * own), log_weight, 0.0)
        for phi, log_weight in shapes.factors
    ]
    return Likelihood(nodes).log(misfits)


def test_exchanged_sensors_count_for_nothing() -> None:
    model = as_made("beam2", ROD)
    theta, exchanged = truth(model), truth(model, log10_k1=7.0, log10_k3=4.0)
    right = MeasuredShapes([measured(model, theta)], ROD)
    wrong = MeasuredShapes([measured(model, theta, PLACES_M[::-1])], ROD)
    fits = right.misfits(model, theta)
    assert right.gross_probability(fits) < 0.01
    assert wrong.gross_probability(wrong.misfits(model, theta)) > 0.999
    either = np.vstack([theta, exchanged])
    sure, unsure = (
        np.ptp(log_likelihood(each, each.misfits(model, either))) for each in (right, wrong)
    )
    assert sure > 20
    assert unsure < sure / 3


def test_tests_of_one_mode_are_one_shape_whose_sensors_still_err() -> None:
    model = as_made("beam2", ROD)
    theta = truth(model)
    test = measured(model, theta)
    first = replace(test, modes=test.modes[:1])
    one, many = MeasuredShapes([first], ROD), MeasuredShapes([first] * 100, ROD)
    assert one.size == many.size == len(PLACES_M) - 1
    off = truth(model, log10_k1=4.3)
    ratio = np.sum(many.misfits(model, off) ** 2) / np.sum(one.misfits(model, off) ** 2)
    assert 1 < ratio < 5  # and not 100: gains and places repeat


def test_ends_are_exchanged_only_where_nothing_tells_them_apart() -> None:
    model = as_made("beam2", ROD)
    shaped = measured(model, truth(model))
    bare = replace(shaped, modes=tuple(replace(m, shape=()) for m in shaped.modes))
    unknown = replace(
        shaped,
        modes=tuple(
            replace(m, shape=tuple(replace(p, sd=float("nan")) for p in m.shape))
            for m in shaped.modes
        ),
    )
    assert swaps_of(model, [bare]) == swaps_of(model, [unknown]) == model.swaps != ()
    assert swaps_of(model, [shaped]) == ()
    assert swaps_of(model, [replace(bare, added_mass=AddedMass(5.0, 1.0))]) == ()


def test_shapes_narrow_the_tension_and_exchanged_sensors_are_named() -> None:
    model = as_made("beam2", ROD)
    theta = truth(model)
    options = UpdateOptions(samples=500, seed=3)
    right, wrong = measured(model, theta), measured(model, theta, PLACES_M[::-1])
    bare = replace(right, modes=tuple(replace(m, shape=()) for m in right.modes))
    shaped, alone, odd = (update([each], model, options) for each in (right, bare, wrong))
    assert shaped.tension_n.std() < 0.7 * alone.tension_n.std()
    assert odd.tension_n.std() > 0.7 * alone.tension_n.std()
    low, high = np.quantile(shaped.tension_n, [0.05, 0.95])
    assert low < 1.1 * ROD.nominal_tension_n < high
    assert [each.remarks for each in (shaped, alone)] == [(), ()]
    assert "place, the plane and the sign of each sensor" in odd.faults[0]
