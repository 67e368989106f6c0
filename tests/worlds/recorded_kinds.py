"""The kinds of `recordings`: what each changes of the plain test, and the physical reason.

All else stays on in every kind: turned sensors, cross-axis hearing, hits off the plane, delays
between channels, hum, drift, coloured noise, wind, deck modes, a clock that is a little wrong.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

RATES_HZ = (200, 256, 400, 500, 512, 600, 800, 1000, 1024, 1200, 1652, 2000, 2048, 2560, 4096, 5000)
Excitation = Literal["hammer", "taps", "release", "wind", "trucks"]


@dataclass(frozen=True)
class Plan:
    """What a kind may change; as it stands it is the plain test."""

    excitation: Excitation = "hammer"
    structure: Literal["hanger", "five", "frame", "bridge"] = "hanger"
    one_axis: bool = False
    hits: tuple[int, int] = (3, 8)
    rebounds: float = 0.06  # share of hits
    pre_trigger: bool = True
    seconds: tuple[float, float] = (20.0, 60.0)
    rates_hz: tuple[int, ...] = RATES_HZ
    change: float = 0.0  # sign of the frequency's change with amplitude; its size is drawn
    sensor_kg: tuple[float, float] = (0.005, 0.2)
    noise: float = 1.0
    force: float = 1.0
    clip: Literal["", "force", "acceleration"] = ""
    hum_at_mode: bool = False
    close: bool = False
    first_hz: tuple[float, float] = (0.0, np.inf)
    modulated: bool = False
    second_harmonic: bool = False
    fault: Literal["", "dead", "nan", "stuck", "gain"] = ""
    quiet: bool = False  # no nuisance at all: for proofs


@dataclass(frozen=True)
class Kind:
    plan: Plan
    reason: str


_WIND = Plan(excitation="wind", seconds=(240, 450), rates_hz=(200, 256))
_TAPS = Plan(excitation="taps", hits=(2, 6))

KINDS: dict[str, Kind] = {
    "plain": Kind(Plan(), "two-axis sensors, hits well apart, nothing unusual"),
    "one_axis": Kind(
        Plan(one_axis=True),
        "single-axis sensors see the other plane through 3 % cross-axis and their turned mount",
    ),
    "clipped_acceleration": Kind(
        Plan(clip="acceleration"), "a range set too small: the converter stops at half the peak"
    ),
    "clipped_force": Kind(Plan(clip="force"), "a hit harder than the hammer's range"),
    "softening": Kind(
        Plan(change=-1.0), "a joint slips a little: frequency falls with amplitude, 0.02 to 0.2 %"
    ),
    "hardening": Kind(
        Plan(change=1.0), "deflection stretches the bar: frequency rises with its square"
    ),
    "single_hit": Kind(Plan(hits=(1, 1)), "a crew in a hurry: nothing says how well it repeats"),
    "no_pre_trigger": Kind(
        Plan(hits=(1, 3), pre_trigger=False), "a triggered logger without memory starts in the hit"
    ),
    "taps": Kind(_TAPS, "a mallet without a sensor: several hits of unknown force"),
    "quick_release": Kind(
        replace(_TAPS, excitation="release", hits=(1, 3)), "pulled by a rope that is cut"
    ),
    "ambient": Kind(_WIND, "wind alone, stationary, on a hanger"),
    "ambient_trucks": Kind(
        replace(_WIND, excitation="trucks"), "trucks pass: bursts of a few seconds over the wind"
    ),
    "any_five_modes": Kind(
        replace(_WIND, structure="five", one_axis=True), "no bar: five unequal masses in a chain"
    ),
    "any_shear_frame": Kind(
        replace(_WIND, structure="frame", one_axis=True), "no bar: a building of five storeys"
    ),
    "any_bridge": Kind(
        replace(_WIND, structure="bridge", one_axis=True), "no bar: a deck, two modes 1 % apart"
    ),
    "hum_at_mode": Kind(
        Plan(hum_at_mode=True, rates_hz=RATES_HZ[2:]), "the mains' line on a mode: looks undamped"
    ),
    "double_hits": Kind(Plan(rebounds=0.7), "the hanger comes back and meets the hammer again"),
    "low_signal": Kind(Plan(noise=20.0, force=0.05), "a light tap on a heavy hanger, a phone"),
    "close_planes": Kind(
        Plan(close=True), "nearly equal springs in both planes: pairs 0.3 % apart beat"
    ),
    "short_record": Kind(
        Plan(hits=(1, 2), seconds=(2.0, 4.0)), "a logger set to 2 to 4 s: resolution 0.25 Hz"
    ),
    "low_rate": Kind(
        Plan(rates_hz=(200,), first_hz=(14.0, 40.0)), "a monitoring logger: 2 to 6 modes in band"
    ),
    "heavy_sensor": Kind(
        Plan(sensor_kg=(1.0, 4.0)), "a geophone or a clamp of kilograms lowers the frequencies"
    ),
    "sidebands": Kind(
        Plan(modulated=True), "a slow machine modulates the ringing: lines beside each mode"
    ),
    "second_harmonic": Kind(
        Plan(second_harmonic=True), "tension rises with the square of deflection: a line at 2 f1"
    ),
    "dead_channel": Kind(Plan(fault="dead"), "a broken cable: offset and the last bit alone"),
    "dropout_nan": Kind(Plan(fault="nan"), "a radio link loses samples: they are missing"),
    "dropout_stuck": Kind(Plan(fault="stuck"), "a driver repeats the last value"),
    "wrong_gain": Kind(
        Plan(fault="gain"), "a wrong unit or sensitivity: a channel is off by a factor"
    ),
}
