"""Sensors of one axis that also hear the other plane, and what is forced into no bar's pattern."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.errors import NotIdentifiable
from shm.identify import Identification
from shm.identify.contract import FoundMode, Poles, Tone
from shm.identify.mode_ordering.numbering import LEAST_MARGIN
from shm.identify.mode_ordering.placement import Placement, place_modes
from shm.report.shared_tables import headline
from shm.values import NAN, PLANES, Hanger, ModalTest, ResponsePoint
from shm.values.modes import NUMBERING
from tests.identify.test_foreign import HANGER, PLACES, STATE, hanger_modes
from tests.worlds.simulated.elements import plane_modes

POINTS = tuple(ResponsePoint(f"{x}", "transverse", x) for x in PLACES)
HEARD_ACROSS = np.array([0.09, -0.05, 0.03])
"""What each of three sensors hears of the other plane: each is turned by its own angle."""


def _modes(sensors: int, across: float = 1.0, own: float = 1.0, orders: int = 7) -> list[FoundMode]:
    """Both planes as the sensors hear them, hit `across` the axis and along it (`own`)."""
    found = []
    for plane, heard, hit in zip(PLANES, (np.ones(3), HEARD_ACROSS), (own, across), strict=True):
        modes = plane_modes(HANGER, STATE, plane, orders)
        for omega, shape in zip(modes.angular_frequency_rad_s, modes.at(PLACES).T, strict=True):
            values = (heard * shape)[:sensors]
            largest = float(np.abs(values).max())
            values = values / largest
            hz = float(omega) / (2 * np.pi)
            sd = np.full(sensors, 0.002)
            found.append(FoundMode(hz, 1e-4 * hz, 0.003, 1e-4, values, sd, hit * largest))
    return sorted(found, key=lambda mode: mode.frequency_hz)


TRUE_HZ = plane_modes(HANGER, STATE, "transverse", 7).angular_frequency_rad_s / (2 * np.pi)


def _right(placement: Placement) -> bool:
    return all(
        mode.plane == "transverse"
        and mode.frequency_hz == pytest.approx(TRUE_HZ[mode.order - 1], rel=1e-9)
        for mode in placement.modes
    )


@pytest.mark.parametrize("sensors", [1, 3])
def test_the_stronger_of_two_series_is_the_axis_own(sensors: int) -> None:
    placement = place_modes(_modes(sensors), POINTS[:sensors], HANGER)
    assert [mode.order for mode in placement.modes] == [1, 2, 3, 4, 5, 6, 7]
    assert _right(placement)
    assert len(placement.foreign_modes) == 7
    assert all("other plane" in mode.reason for mode in placement.foreign_modes)


def test_what_one_axis_does_not_say_is_warned_of() -> None:
    check = place_modes(_modes(1), POINTS[:1], HANGER).check
    assert check is not None
    assert check.verdict == "warning"
    assert "biaxial" in check.remedy
    alone = [m for m in _modes(1) if np.isclose(TRUE_HZ, m.frequency_hz, rtol=1e-9).any()]
    sound = place_modes(alone, POINTS[:1], HANGER).check
    assert sound is not None
    assert sound.verdict == "good"


def test_hit_across_the_axis_the_shapes_tell_which_series_is_its_own() -> None:
    """The other plane's modes are the stronger ones, and have no shape of a bar."""
    placement = place_modes(_modes(3, across=1.0, own=0.05), POINTS, HANGER)
    assert len(placement.modes) >= 6
    assert _right(placement)


def test_where_nothing_tells_which_is_whose_neither_has_an_order() -> None:
    """One sensor, and both as strong."""
    equal = [replace(mode, acceleration_m_s2=1.0) for mode in _modes(1)]
    placement = place_modes(equal, POINTS[:1], HANGER)
    assert placement.modes == ()
    assert len(placement.foreign_modes) == len(equal)


def test_a_mode_of_the_other_plane_alone_is_known_by_its_shape() -> None:
    rest = [m for m in _modes(3) if not np.isclose(m.frequency_hz, TRUE_HZ[2], rtol=1e-9)]
    placement = place_modes(rest, POINTS, HANGER)
    assert [mode.order for mode in placement.modes] == [1, 2, 4, 5, 6, 7]
    assert _right(placement)


def test_orders_that_may_be_others_are_not_guessed_where_the_hanger_is_described() -> None:
    """Three high orders of one plane, and a tension that may be 0.55 to 1.8 of nominal."""
    high = [m for m in _modes(1, orders=12) if m.acceleration_m_s2 > 0][-6:]
    own = [m for m in high if np.isclose(_far(12), m.frequency_hz, rtol=1e-9).any()]
    described = place_modes(own, POINTS[:1], HANGER)
    assert described.modes == ()
    assert all("not guessed" in mode.reason for mode in described.foreign_modes)
    kinds = {(mode.kind, mode.plane, mode.frequency_sd_hz > 0) for mode in described.foreign_modes}
    assert kinds == {("unnumbered", None, True)}
    assert described.check is not None
    assert (described.check.name, described.check.verdict) == (NUMBERING, "refused")
    assert headline([described.check]).startswith("Do not use: the orders of the modes are not")
    none = np.empty(0)
    found = Identification(
        ModalTest("t", ()), None, (), (), Poles(none, none, none, none.astype(bool)),
        quality=(described.check,), set_aside=described.foreign_modes,
    )  # fmt: skip
    with pytest.raises(NotIdentifiable, match=f"{own[0].frequency_hz:.4g}, .* Hz"):
        found.with_orders("t.csv")
    plain = place_modes(own, POINTS[:1], None)
    assert len(plain.modes) == len(own)
    assert plain.check is not None
    assert plain.check.verdict == "warning"
    assert plain.check.value < LEAST_MARGIN


def _far(orders: int) -> np.ndarray:
    modes = plane_modes(HANGER, STATE, "transverse", orders)
    return np.asarray(modes.angular_frequency_rad_s / (2 * np.pi))


def test_what_fits_no_bar_is_not_counted_where_a_hanger_is_described() -> None:
    found = [replace(_modes(1)[0], frequency_hz=hz) for hz in (10.0, 10.9, 11.7, 12.5, 90.0)]
    assert place_modes(found, POINTS[:1], HANGER).modes == ()
    counted = place_modes(found, POINTS[:1], None)
    assert counted.check is not None
    assert counted.check.verdict == "warning"


DECK = Hanger.without_model(100, "Deck")


def test_modes_of_what_no_model_describes_are_listed_by_frequency() -> None:
    """Neither a series, nor planes that share their orders, nor a neighbour's mode."""
    found = [replace(_modes(1)[0], frequency_hz=hz) for hz in (2.1, 2.12, 7.0, 7.9, 31.0)]
    placement = place_modes(found, [ResponsePoint("deck", None, NAN)], DECK)
    assert [mode.order for mode in placement.modes] == [1, 2, 3, 4, 5]
    assert [mode.frequency_hz for mode in placement.modes] == [2.1, 2.12, 7.0, 7.9, 31.0]
    assert placement.foreign_modes == ()
    assert placement.check is None
    assert any("listed by frequency" in note for note in placement.notes)


def test_a_tone_is_no_mode_of_what_no_model_describes() -> None:
    found = [replace(_modes(1)[0], frequency_hz=hz) for hz in (2.1, 7.0, 31.0)]
    hum = replace(found[0], frequency_hz=50.0, damping_ratio=1e-6)
    placement = place_modes([*found, hum], [ResponsePoint("deck")], DECK, (Tone(50.0, "mains"),))
    assert [mode.frequency_hz for mode in placement.modes] == [2.1, 7.0, 31.0]
    assert [mode.kind for mode in placement.foreign_modes] == ["tone"]


def test_biaxial_sensors_say_in_which_direction_each_moves() -> None:
    points = [ResponsePoint("y", "transverse", 1.0), ResponsePoint("z", "longitudinal", 1.0)]
    one, two = hanger_modes()[:2]
    shapes = (np.array([1.0, 0.1]), np.array([0.2, 1.0]))
    found = [replace(m, shape=s, shape_sd=0 * s) for m, s in zip((one, two), shapes, strict=True)]
    placement = place_modes(found, points, DECK)
    assert [(m.plane, m.order) for m in placement.modes] == [("transverse", 1), ("longitudinal", 2)]
