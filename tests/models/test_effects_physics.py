"""What each effect does to a hanger, against closed forms and exact beams.

Where nothing else is said: hanger 3 at its nominal tension, clamped, frequencies of six modes a
plane. Beams are exact: `beam1` is the clamped beam under tension, `beam2` has end springs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from shm.models import THESIS, build
from shm.models.effects import EFFECTS, Case, Conditions, Survey, Variant
from shm.models.hanger import HangerModes, PhysicalHanger, solve
from shm.models.hanger.physical import Zone
from shm.values import PLANES, Hanger
from tests.helpers.hangers import ROD

MODES = 6
PLACES_M = np.array([1.2, 3.6, 5.1, 8.3])
RICH = Survey(("t1", "t2"), PLANES, tuple(PLACES_M), True, (2.0, 22.0), (0.5, 1.0), ())


def place(name: str, at: str, hanger: Hanger = ROD) -> Variant:
    found = {variant.at: variant for variant in EFFECTS[name].variants(hanger, RICH)}
    return found[at]


def physical(
    name: str = "",
    at: str = "everywhere",
    values: tuple[float, ...] = (),
    hanger: Hanger = ROD,
    conditions: Conditions = Conditions("t1"),  # noqa: B008
) -> PhysicalHanger:
    """One hanger with one effect, or with none."""
    tension_n = np.array([hanger.nominal_tension_n])
    bare = PhysicalHanger.clamped(hanger, tension_n, sensors=len(PLACES_M))
    if not name:
        return bare
    return EFFECTS[name].act(
        bare, np.array([values]), Case(hanger, place(name, at, hanger), conditions)
    )


def solved(one: PhysicalHanger, places_m: np.ndarray = PLACES_M) -> HangerModes:
    return solve(one, MODES, places_m)


def frequencies(*args: object, **kwargs: object) -> np.ndarray:
    """(planes, modes)."""
    return solved(physical(*args, **kwargs)).frequency_hz[0]


def exact(kind: str, hanger: Hanger = ROD, **values: float) -> np.ndarray:
    """Frequencies of an exact beam (planes, modes)."""
    beam = build(kind, hanger, THESIS)
    theta: Mapping[str, float] = {"theta_F": 1.0, "theta_L": 1.0} | values
    return beam.frequencies_hz(beam.pack(theta)[None], MODES)[0]


def test_a_slow_clock_raises_all_frequencies_alike_and_leaves_the_shapes() -> None:
    slow = solved(physical("timebase", "all tests", (0.003,)))
    np.testing.assert_allclose(slow.frequency_hz[0], 1.003 * frequencies(), rtol=1e-12)
    np.testing.assert_allclose(slow.shape, solved(physical()).shape)


def test_warmth_and_level_change_the_tension() -> None:
    warm = Conditions("t1", temperature_shift_k=10.0, amplitude=2.0)
    slack = physical("temperature_tension", values=(-3000.0,), conditions=warm)
    tight = physical("geometric_hardening", values=(0.01,), conditions=warm)
    assert slack.tension_n == pytest.approx(711e3 - 30e3)
    assert tight.tension_n == pytest.approx(711e3 * 1.04)


def test_a_joint_is_a_spring_that_falls_with_the_level() -> None:
    half = Conditions("t1", amplitude=0.5)
    joint = frequencies("joint_softening", "deck end", (6.5,), conditions=half)
    k = 6.5 + np.log10(2.0)
    spring = frequencies("rotational_end_flexibility", "deck end", (k, k))
    np.testing.assert_allclose(joint, spring, rtol=1e-12)


def test_only_the_joints_part_of_an_end_spring_damps() -> None:
    """Springs in series share energy as compliance: 0.1 times level times share."""
    bare = replace(
        physical(), rotational_compliance_rad_n_m=np.full((1, 2, 2, 2), 3e-7) * np.eye(2)
    )
    joint = EFFECTS["joint_softening"].act(
        bare, np.array([[7.0]]), Case(ROD, place("joint_softening", "deck end"))
    )
    np.testing.assert_allclose(joint.joint_loss_factor, [[0.1 * 0.25, 0.0]])


def test_a_turned_sensor_sees_a_mode_under_its_angle() -> None:
    """Turned by a from the transverse axis, it sees cos a and -sin a of a transverse motion."""
    seen = solved(physical("sensor_misalignment", "sensor at 3.60 m", (10.0,))).shape[0, 0, 0]
    straight = solved(physical()).shape[0, 0, 0]
    np.testing.assert_allclose(seen[[0, 2, 3], 1], 0, atol=1e-12)
    assert abs(seen[1, 1] / seen[1, 0]) == pytest.approx(np.tan(np.radians(10)))
    assert np.sign(seen[1, 1]) == -np.sign(straight[1, 0])


@pytest.mark.parametrize("change_m", [-0.9, 0.6])
def test_another_length_takes_its_fitting_along(change_m: float) -> None:
    """Compare with a bar that was described with that length, fittings and all."""

    def fitted(length_m: float) -> PhysicalHanger:
        hanger = replace(ROD, length_m=length_m)
        bar = PhysicalHanger.clamped(hanger, np.array([7e5]), 0)
        near, far = (np.array([each]) for each in (length_m - 0.7, length_m))
        stiff = Zone(near, far, np.array([5.0]), np.array([2.0]))
        return replace(bar, zones=(stiff,))

    at_arch = place("effective_length", "arch end")
    case = Case(ROD, at_arch, Conditions())
    moved = EFFECTS["effective_length"].act(fitted(12.0), np.array([[change_m]]), case)
    found, meant = (
        solve(each, 8, np.empty(0), shapes=False).frequency_hz
        for each in (moved, fitted(12.0 + change_m))
    )
    np.testing.assert_allclose(found, meant, rtol=1e-7)
