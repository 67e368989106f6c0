"""What an end does as it loosens that the slopes do not say: against the model itself."""

from __future__ import annotations

import numpy as np
import pytest

from shm.models import described
from shm.values import TENSION
from shm.watch.quantities import base_point, log_frequencies, watched_quantities
from shm.watch.reading_corrections import loosening_of
from tests.helpers.hangers import HANGER_3
from tests.helpers.modelled_tests import posterior

MODES = tuple((plane, order) for plane in ("longitudinal", "transverse") for order in range(1, 6))
CLAMPED = (1.0, 1.0, 8.4, 8.4, 8.4, 8.4)
"""A baseline that says "clamped"."""


@pytest.fixture(scope="module")
def found():  # type: ignore[no-untyped-def]
    model = described("beam2", HANGER_3)
    baseline = posterior(CLAMPED)
    base = base_point(baseline, model)
    quantities = watched_quantities(baseline, HANGER_3, MODES)
    return model, base, quantities, loosening_of(model, base, HANGER_3, MODES, quantities)


def test_the_tension_has_no_pattern_and_each_end_has_its_own_plane_s(found) -> None:  # type: ignore[no-untyped-def]
    _, _, quantities, patterns = found
    planes = np.array([plane for plane, _ in MODES])
    for quantity, rows in zip(quantities, patterns, strict=True):
        if quantity.name == TENSION:
            assert rows.shape == (0, len(MODES))
        else:
            assert len(rows)
            assert np.abs(rows[:, planes != quantity.plane]).max() < 1e-12
            # What is beside the mean: the mean itself is the quantity's.
            assert np.abs(rows.mean(axis=1)).max() < 1e-3 * np.abs(rows).max()


def test_an_end_that_was_softer_than_it_looked_goes_along_slopes_and_patterns(found) -> None:  # type: ignore[no-untyped-def]
    """The spring of one end to a third, from where it was soft: the slopes of a clamp miss it."""
    model, base, quantities, patterns = found
    column = model.parameter_names.index("log10_k1")
    plane = quantities[[each.parameters for each in quantities].index(_own(quantities, "log10_k1"))]
    rows = patterns[quantities.index(plane)]
    own = np.array([each == plane.plane for each, _ in MODES])
    soft = np.tile(base, (2, 1))
    soft[:, column] = [6.6, 6.6 - np.log10(3)]
    before, after = log_frequencies(model, soft, MODES)
    shift = (after - before)[own]
    stiff = np.tile(base, (2, 1))
    stiff[1, [model.parameter_names.index(name) for name in plane.parameters]] -= 0.3
    slope = np.diff(log_frequencies(model, stiff, MODES), axis=0)[0, own]

    def left(*columns) -> float:  # type: ignore[no-untyped-def]
        design = np.array(columns).T
        fit = np.linalg.lstsq(design, shift, rcond=None)[0]
        return float(np.linalg.norm(shift - design @ fit))

    assert left(slope, *rows[:, own]) < 0.35 * left(slope)


def _own(quantities, name: str) -> tuple[str, ...]:  # type: ignore[no-untyped-def]
    (found,) = [each.parameters for each in quantities if name in each.parameters]
    return tuple(found)
