"""What the world of gapped hangers plants and draws; its bar stands in `test_bars.py`."""

import math
from itertools import pairwise

import numpy as np
import pytest

from tests.worlds.gapped_hangers import (
    CAUSES,
    Draws,
    Fault,
    Hanger,
    Nuisances,
    compare,
    draw_hanger,
    find_slopes,
    make_case,
    solve,
)

pytestmark = pytest.mark.trial  # of the world alone: it shares nothing with the product


def test_make_case_repeats() -> None:
    one, two = (make_case(3, 7, ("crack",)) for _ in range(2))
    assert (one.hanger_toml, one.modes, one.truth) == (two.hanger_toml, two.modes, two.truth)
    assert one.modes != make_case(4, 7, ("crack",)).modes


def test_measure_errors_are_as_stated() -> None:
    """Without nuisances the tests of a sound hanger differ by the stated error alone."""
    quiet = Nuisances(
        tension_between_tests=0.0, tension_per_kelvin=0.0, misstated=0.0, repeat=(1e-9, 2e-9)
    )
    z = []
    for index in range(40):
        case = make_case(9, index, (), quiet)
        tests = case.modes["tests"]
        for one, two in pairwise(tests):
            for a, b in zip(one["modes"], two["modes"], strict=True):
                sd = math.hypot(a["frequency_sd_hz"], b["frequency_sd_hz"])
                z.append((a["frequency_hz"] - b["frequency_hz"]) / sd)
    assert len(z) > 500
    assert np.std(z) == pytest.approx(1.0, abs=0.1)


def _hanger(*needs: str) -> Hanger:
    return draw_hanger(Draws(12, 1, 1847), frozenset(needs), Nuisances())


@pytest.mark.parametrize("cause", CAUSES)
def test_plant_vanishes_with_its_size(cause: str) -> None:
    hanger = _hanger("shapes", "levels", "temperatures")
    sound = solve(hanger, ())
    slopes = find_slopes(hanger, sound, Nuisances())
    faults = [Fault(cause, size * CAUSES[cause].low, 0.37) for size in (0.005, 1.0)]
    small, large = (compare(hanger, sound, solve(hanger, (fault,)), slopes)[1] for fault in faults)
    assert small < 0.1 * large
    assert large > 0


@pytest.mark.parametrize(
    ("cause", "sign"),
    [
        *(("mass at a point", -1), ("guide", 1), ("end that turns", -1), ("end that gives", -1)),
        *(("mass all along", -1), ("mass over a stretch", -1), ("stiff end", 1), ("crack", -1)),
        *(("joints that soften", -1), ("loose wire", 1), ("other length", -1)),
        *(("clock in all tests", 1), ("other stiffness", 1)),
    ],
)
def test_plant_changes_frequencies_by_sign(cause: str, sign: int) -> None:
    hanger = _hanger("levels")
    fault = Fault(cause, CAUSES[cause].low * 3, 0.37)
    sound, faulty = solve(hanger, ()), solve(hanger, (fault,))
    changes = np.concatenate(
        [
            faulty.modes[key].frequencies_hz * faulty.clock[key[0]] / modes.frequencies_hz - 1
            for key, modes in sound.modes.items()
        ]
    )
    assert (sign * changes > -1e-6).all()  # other nodes
    assert (sign * changes > 1e-5).any()
