"""Values of an identification: modes and tests."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Literal

from shm.values.kinds import NAN, Plane, Verdict
from shm.values.recording import AddedMass
from shm.values.rounding import NINETY_PERCENT, tension_words
from shm.values.showing import Displayable, front, line

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True)
class ShapePoint:
    """A mode shape at one place: `value` in the mode's plane, `cross` in the other plane."""

    x_m: float
    value: float
    cross: float = NAN
    sd: float = NAN


@dataclass(frozen=True)
class Mode:
    """One identified mode. `order` counts from 1 in each plane; standard deviations may be NaN.

    `acceleration_m_s2` is the amplitude with which it rings right after a hit, at the sensor that
    moves most (median over the hits). `irregular`: it is well off the tensioned beam that the
    others follow, as sag raises a first order. Diagnoses take it, no tension is inferred from it.
    `amplitude_slope` is the change of the frequency, as a fraction, from small amplitude to
    that of a median hit, negative where a joint slips, with its standard deviation; NaN where the
    ring-downs do not say.
    """

    plane: Plane
    order: int
    frequency_hz: float
    frequency_sd_hz: float = NAN
    damping_ratio: float = NAN
    damping_sd: float = NAN
    shape: tuple[ShapePoint, ...] = ()
    acceleration_m_s2: float = NAN
    irregular: bool = False
    amplitude_slope: float = NAN
    amplitude_slope_sd: float = NAN

    @property
    def depends_on_amplitude(self) -> bool:
        """Return True if its slope is significant: `frequency_hz` is that of small amplitude."""
        slope = abs(self.amplitude_slope)
        return SLOPE_OF_NOTE <= slope < MOST_SLOPE and slope > SURE_SDS * self.amplitude_slope_sd


SURE_SDS = 2.5
"""Standard deviations from which a slope is taken for one (judgement): by chance one in 80."""
SLOPE_OF_NOTE = 1e-4
"""Relative: a logger's clock and a tenth of a kelvin do as much from test to test (judgement)."""
MOST_SLOPE = 0.01
"""Relative: what joints and stretching do is tenths of a percent; more is another line's phase."""


@dataclass(frozen=True)
class ForeignMode:
    """A resonance or tone in a test that is not known as a mode of the hanger, and why not.

    `kind`: `harmonic` (a multiple of another mode's frequency), `tone` (mains, a machine), `deck`
    (the bridge or another neighbour moves the hanger) or `unnumbered` (identified as a mode, but of
    an order that is not known); of the latter the standard deviations are known, and the plane if
    it moves in one alone.
    """

    kind: Literal["harmonic", "tone", "deck", "unnumbered"]
    frequency_hz: float
    damping_ratio: float
    reason: str
    plane: Plane | None = None
    frequency_sd_hz: float = NAN
    damping_sd: float = NAN


@dataclass(frozen=True)
class QualityCheck:
    """One figure of a test's quality beside its limit, and what to do where it is not met.

    `value` and `limit` are in `unit` (empty: none); `found` says what was seen and where; `remedy`
    is what the crew should do, empty where the verdict is good. A figure that these records do not
    give is NaN and `unknown`; a test with a `refused` check is not used.
    """

    name: str
    verdict: Verdict
    value: float
    limit: float
    unit: str
    found: str
    remedy: str = ""


FIRST_ORDERS = "first orders"
"""Name of the check that the lowest modes of each plane were found; it is part of the headline."""

NUMBERING = "numbering"
"""Name of the check that orders are known; where none is, it is part of the headline."""

LONGEST_TEST_ID = 200
"""Characters; as long as the name of a file may be, see `shm.store.archive.safe_name`."""


def is_test_id(text: str) -> bool:
    """Return True if a text may name a test."""
    return 0 < len(text) <= LONGEST_TEST_ID and text.isprintable()


def as_test_id(name: str) -> str:
    """Return an id out of any name: what cannot be printed or would break a line is "_"."""
    return printable(name)[:LONGEST_TEST_ID] or "_"


def printable(text: str, instead: str = "_") -> str:
    """Return a text with something else `instead` of each character that cannot be printed."""
    return "".join(each if each.isprintable() else instead for each in text)


@dataclass(frozen=True)
class ModalTest(Displayable):
    """One hammer test of a hanger: its identified modes and conditions.

    `id` is of 1 to LONGEST_TEST_ID printable characters, else that is a ValueError: no document
    with another can be read back. `tension_read_n` is what a load cell or a lift-off showed during
    the test, with the reading's standard deviation. Above the level `rattles_above` (in the unit of
    `amplitude`) the hanger does not ring as a bar does; NaN where it does at that of the hits, too.
    """

    id: str
    modes: tuple[Mode, ...]
    hanger: int | None = None
    time: datetime | None = None
    temperature_c: float = NAN
    amplitude: float = NAN
    added_mass: AddedMass | None = None
    tension_read_n: float = NAN
    tension_read_sd_n: float = NAN
    rattles_above: float = NAN
    operator: str = ""

    def __post_init__(self) -> None:
        if not is_test_id(self.id):
            raise ValueError(f"{self.id!r} is no id of a test; see as_test_id")

    def __repr__(self) -> str:
        found_hz = [mode.frequency_hz for mode in self.modes]
        text = f"{len(found_hz)} modes"
        if found_hz:
            text += f", {min(found_hz):.3f} to {max(found_hz):.3f} Hz"
        read_n, half_n = self.tension_read_n, NINETY_PERCENT * self.tension_read_sd_n
        if math.isfinite(read_n):
            text += f", read {tension_words(read_n, read_n - half_n, read_n + half_n)}"
        return line(f"ModalTest {self.id}", self.hanger, text)

    def to_dataframe(self) -> DataFrame:
        """Return the modes, a row a mode: the table of `shm.export.modes`."""
        table: DataFrame = front().export.modes([self])
        return table

    @property
    def regular_modes(self) -> tuple[Mode, ...]:
        """Return the modes from which a tension is inferred; see `Mode.irregular`."""
        return tuple(mode for mode in self.modes if not mode.irregular)

    @property
    def widest_swing_m(self) -> float:
        """Return the sensors' largest motion, all modes of a plane together; NaN if unknown."""
        swings = {mode.plane: 0.0 for mode in self.modes}
        for mode in self.modes:
            if math.isfinite(mode.acceleration_m_s2):
                swings[mode.plane] += (
                    mode.acceleration_m_s2 / (2 * math.pi * mode.frequency_hz) ** 2
                )
        return max(swings.values(), default=0.0) or NAN

    @property
    def frequencies_amplitude(self) -> float:
        """The amplitude that its frequencies belong to: 0 where a slope led to small amplitude."""
        return 0.0 if any(mode.depends_on_amplitude for mode in self.modes) else self.amplitude
