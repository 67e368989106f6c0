"""What rings without being a mode of the hanger is set aside, named, and takes no order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.identify.contract import FoundMode, Tone
from shm.identify.mode_ordering.placement import Placement, place_modes
from shm.simulate import HangerState
from shm.values import PLANES, Hanger, ResponsePoint
from tests.worlds.simulated.elements import plane_modes

HANGER = Hanger(1, 12.0, 200e9, 0.00283, 6.4e-7, 22.1, 300e3)
STATE = HangerState(310e3, 3e5, 1e5, 2e5, 8e5)
PLACES = np.array([1.1, 2.3, 3.2])
POINTS = tuple(ResponsePoint(f"{x} {plane}", plane, x) for x in PLACES for plane in PLANES)
STRING = replace(HANGER, second_moment_m4=6.4e-10)


def found_at(
    frequency_hz: float, shape: np.ndarray, angle_deg: float = 0.0, damping: float = 0.003
) -> FoundMode:
    """Return a mode of that `shape`, at an angle from the transverse plane."""
    angle = np.radians(angle_deg)
    values = np.outer(shape, [np.cos(angle), np.sin(angle)]).ravel()
    values = values / np.abs(values).max()
    return FoundMode(frequency_hz, 1e-4 * frequency_hz, damping, 0.05 * damping, values,
                     np.full(len(values), 0.01))  # fmt: skip


def hanger_modes(hanger: Hanger = HANGER, orders: int = 7) -> list[FoundMode]:
    found = []
    for plane, angle in zip(PLANES, (0.0, 90.0), strict=True):
        modes = plane_modes(hanger, STATE, plane, orders)
        frequencies = modes.angular_frequency_rad_s / (2 * np.pi)
        shapes = modes.at(PLACES).T
        found += [found_at(f, s, angle) for f, s in zip(frequencies, shapes, strict=True)]
    return sorted(found, key=lambda mode: mode.frequency_hz)


def with_foreign(foreign: FoundMode, *, tones: tuple[Tone, ...] = ()) -> Placement:
    found = sorted([*hanger_modes(), foreign], key=lambda mode: mode.frequency_hz)
    return place_modes(found, POINTS, HANGER, tones)


def orders_of(placement: Placement) -> dict[str, list[int]]:
    return {plane: [m.order for m in placement.modes if m.plane == plane] for plane in PLANES}


COUNTED = {plane: list(range(1, 8)) for plane in PLANES}


def test_a_hanger_alone_has_nothing_set_aside() -> None:
    placement = place_modes(hanger_modes(), POINTS, HANGER)
    assert orders_of(placement) == COUNTED
    assert placement.foreign_modes == ()
    assert placement.notes == ()


@pytest.mark.parametrize("fold", [2, 3])
def test_a_multiple_of_a_mode_with_its_shape_is_a_harmonic(fold: int) -> None:
    base = hanger_modes()[0]
    placement = with_foreign(replace(base, frequency_hz=fold * base.frequency_hz))
    assert orders_of(placement) == COUNTED
    (foreign,) = placement.foreign_modes
    assert foreign.kind == "harmonic"
    assert f"{fold} times the mode at {base.frequency_hz:.3f} Hz" in foreign.reason


def test_the_true_modes_of_a_string_lie_at_multiples_and_stay() -> None:
    """Orders 2 and 3 within 1e-4 of twice and three times the first."""
    state = HangerState(310e3, 0.0, 0.0, 0.0, 0.0)
    modes = plane_modes(STRING, state, "transverse", 6)
    frequencies = modes.angular_frequency_rad_s / (2 * np.pi)
    assert frequencies[1:3] / frequencies[0] == pytest.approx([2, 3], rel=2e-4)
    found = [found_at(f, s) for f, s in zip(frequencies, modes.at(PLACES).T, strict=True)]
    placement = place_modes(found, POINTS, STRING)
    assert [mode.order for mode in placement.modes] == [1, 2, 3, 4, 5, 6]
    assert placement.foreign_modes == ()


def test_of_a_string_mode_and_a_harmonic_beside_it_the_harmonic_goes() -> None:
    """0.3 % apart where the pattern is known to 1 %: the shape of its base gives it away."""
    found = hanger_modes(STRING)
    first = found[0]
    harmonic = replace(first, frequency_hz=2 * first.frequency_hz)
    placement = place_modes(
        sorted([*found, harmonic], key=lambda mode: mode.frequency_hz), POINTS, STRING
    )
    assert [(each.kind, each.frequency_hz) for each in placement.foreign_modes] == [
        ("harmonic", harmonic.frequency_hz)
    ]
    assert orders_of(placement) == COUNTED


@pytest.mark.parametrize(("frequency_hz", "angle_deg"), [(3.1, 0.0), (8.0, 45.0), (13.9, 80.0)])
def test_a_swing_about_the_arch_end_is_the_deck(frequency_hz: float, angle_deg: float) -> None:
    swing = found_at(frequency_hz, 1 - PLACES / HANGER.length_m, angle_deg, damping=0.01)
    placement = with_foreign(swing)
    assert orders_of(placement) == COUNTED
    assert [each.kind for each in placement.foreign_modes] == ["deck"]
    assert placement.foreign_modes[0].damping_ratio == 0.01


def test_a_second_mode_beside_an_order_is_told_from_it_by_its_shape() -> None:
    third = [mode for mode in hanger_modes() if abs(mode.shape[0]) > abs(mode.shape[1])][2]
    swing = found_at(1.006 * third.frequency_hz, 1 - PLACES / HANGER.length_m, damping=0.008)
    placement = with_foreign(swing)
    assert [each.frequency_hz for each in placement.foreign_modes] == [swing.frequency_hz]
    assert "one mode a plane near" in placement.foreign_modes[0].reason


def test_a_named_tone_is_set_aside_with_its_name_even_where_an_order_lies() -> None:
    found = hanger_modes()
    lost = found.pop(4)
    steady = replace(lost, damping_ratio=1e-5)
    tone = Tone(1.0005 * lost.frequency_hz, "pump")
    placement = place_modes(sorted([*found, steady], key=lambda m: m.frequency_hz), POINTS, HANGER,
                       (tone,))  # fmt: skip
    (foreign,) = placement.foreign_modes
    assert foreign.kind == "tone"
    assert "pump" in foreign.reason
    assert len(placement.modes) == len(found)


def test_a_mode_that_decays_is_kept_though_a_tone_lies_there() -> None:
    found = hanger_modes()
    tone = Tone(found[4].frequency_hz, "mains")
    placement = place_modes(found, POINTS, HANGER, (tone,))
    assert orders_of(placement) == COUNTED


def test_what_hardly_decays_and_fits_no_order_is_a_tone_though_nobody_named_it() -> None:
    placement = with_foreign(found_at(16.7, np.array([1.0, -0.3, 0.5]), 40.0, damping=1e-5))
    assert [each.kind for each in placement.foreign_modes] == ["tone"]
    assert orders_of(placement) == COUNTED


def test_without_any_description_a_foreign_mode_is_still_found() -> None:
    found = sorted([*hanger_modes(), found_at(3.1, np.ones(3))], key=lambda mode: mode.frequency_hz)
    placement = place_modes(found, POINTS, None)
    assert orders_of(placement) == COUNTED
    assert [each.frequency_hz for each in placement.foreign_modes] == [3.1]
