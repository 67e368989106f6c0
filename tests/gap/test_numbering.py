"""Wrong orders are told from a gap: planted by the simulator, numbered wrongly by hand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from shm.errors import BadInput
from shm.gap.causes.misfit import doubt_orders
from shm.gap.causes.search import attribute
from shm.gap.diagnose import diagnose
from shm.gap.hypotheses.contract import GapOptions
from shm.simulate import PlantedEffect
from shm.values import ModalTest
from tests.helpers.effects import all_but
from tests.helpers.gap_campaigns import HANGER, problem_of, simulated
from tests.helpers.slow import few_of

CLAMP = PlantedEffect("point_mass", "everywhere", {"mass_kg": 4.0, "x_m": 3.4})
OPTIONS = GapOptions(without=all_but("point_mass", "timebase"))
BOTH = {"transverse": -1, "longitudinal": -1}


def _numbered(shifts: Mapping[str, int], *effects: PlantedEffect) -> list[ModalTest]:
    (test,) = simulated(*effects, shapes=False, tension_spread=0.0)
    modes = [replace(m, order=m.order + shifts.get(m.plane, 0)) for m in test.modes]
    return [replace(test, modes=tuple(mode for mode in modes if mode.order > 0))]


def _remark(tests: list[ModalTest]) -> str:
    problem = problem_of(tests)
    return "".join(doubt_orders(problem, attribute(problem, OPTIONS, np.random.default_rng(1))))


@pytest.mark.parametrize(
    ("shifts", "effects", "said"),
    few_of(
        [
            (BOTH, (), "were the modes of both planes numbered one higher"),
            ({"transverse": -1}, (), "were the transverse modes numbered one higher, the"),
            ({"transverse": 1}, (), "were the transverse modes numbered one lower, "),
            (BOTH, (CLAMP,), "both planes numbered one higher"),
        ],
        1,
    ),
)
def test_wrong_orders_are_said_with_the_right_ones(
    shifts: dict[str, int], effects: tuple[PlantedEffect, ...], said: str
) -> None:
    """Of a sound hanger with its tension; a gap does not hide them."""
    remark = _remark(_numbered(shifts, *effects))
    assert said in remark
    if not effects:
        tension_kn = float(remark.split(", at ")[1].split(" kN")[0])
        assert tension_kn == pytest.approx(711, rel=0.02)


def test_a_mode_missed_in_the_middle_is_said() -> None:
    """Orders 1, 2, 4, 5 numbered 1 to 4, in the plane that was measured."""
    (test, *_) = _numbered({})
    modes = [m for m in test.modes if m.plane == "transverse" and m.order != 3]
    modes = [replace(mode, order=n) for n, mode in enumerate(modes[:4], 1)]
    remark = _remark([replace(test, modes=tuple(modes))])
    assert "the transverse modes above 2 numbered one higher" in remark
    assert "missed between 2 and 3" in remark


@pytest.mark.slow
def test_a_mode_that_is_a_dampers_own_is_said() -> None:
    (test, *_) = _numbered({})
    modes = [m for m in test.modes if m.plane == "transverse"]
    own = replace(modes[1], frequency_hz=1.2 * modes[1].frequency_hz)
    modes = [replace(mode, order=n) for n, mode in enumerate([*modes[:2], own, *modes[2:]], 1)]
    remark = _remark([replace(test, modes=tuple(modes))])
    assert "the transverse mode 3 left out and those above numbered one lower" in remark
    assert "damper" in remark


@pytest.mark.parametrize("effects", [(), (CLAMP,)])
def test_of_right_orders_nothing_is_said(effects: tuple[PlantedEffect, ...]) -> None:
    assert _remark(_numbered({}, *effects)) == ""


@pytest.mark.slow
def test_a_diagnosis_with_wrong_orders_is_refused_with_the_right_ones() -> None:
    with pytest.raises(BadInput, match="The orders look wrong: were the modes of both planes"):
        diagnose(_numbered(BOTH), HANGER, OPTIONS)
    assert not diagnose(_numbered({}), HANGER, OPTIONS).remarks
