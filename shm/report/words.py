"""Numbers in words: units, intervals, signs, times; what is unknown is said, never printed."""

from __future__ import annotations

import math
from datetime import UTC, datetime

from shm.report.content import Interval

_ROTATIONAL_SPRINGS = {
    "k1": "transverse, deck end",
    "k2": "longitudinal, deck end",
    "k3": "transverse, arch end",
    "k4": "longitudinal, arch end",
}
_FACE_SPRINGS = {
    "k1": "large edges, deck end",
    "k2": "small edges, deck end",
    "k3": "small edges, arch end",
    "k4": "large edges, arch end",
    "krx": "across the bridge, deck end",
    "kry": "along the bridge, deck end",
    "klx": "across the bridge, arch end",
    "kly": "along the bridge, arch end",
}
_MEANINGS = {
    "theta_F": "tension over nominal tension",
    "theta_L": "effective over given length",
    "sigma": "model error, as a fraction of a frequency",
}


def decimals(width: float) -> int:
    """Decimals that show two significant digits of half an interval's `width`."""
    if not (math.isfinite(width) and width > 0):
        return 1
    return min(6, max(0, 1 - math.floor(math.log10(width / 2))))


def with_interval(interval: Interval, unit: str) -> str:
    """`655 kN (90 % interval 640 to 671 kN)`."""
    places, space = decimals(interval.width), unit and f" {unit}"
    return (
        f"{interval.mean:.{places}f}{space} (90 % interval "
        f"{interval.low:.{places}f} to {interval.high:.{places}f}{space})"
    )


def span(interval: Interval, signed: bool = False) -> str:
    """`640 to 671`, for a table whose heading names the unit."""
    places, sign = decimals(interval.width), "+" if signed else ""
    return f"{interval.low:{sign}.{places}f} to {interval.high:{sign}.{places}f}"


def mean(interval: Interval, signed: bool = False) -> str:
    """The mean with the decimals that its interval deserves."""
    return f"{interval.mean:{'+' if signed else ''}.{decimals(interval.width)}f}"


def signed_percent(fraction: Interval) -> str:
    """`-8.0 % (90 % interval -9.9 to -6.1 %)`."""
    percent = fraction.scaled(100)
    return f"{mean(percent, signed=True)} % (90 % interval {span(percent, signed=True)} %)"


def number(value: float, form: str, absent: str = "not known") -> str:
    """`value` in format `form`; the words `absent` where it is NaN."""
    return format(value, form) if math.isfinite(value) else absent


def probability(value: float) -> str:
    """Three decimals, with no certainty pretended."""
    if not math.isfinite(value):
        return "not known"
    if value > 0.999:
        return "> 0.999"
    return "< 0.001" if value < 0.001 else f"{value:.3f}"


def temperature(celsius: float) -> str:
    return number(celsius, ".1f") + " °C" if math.isfinite(celsius) else "temperature not recorded"


def moment(time: datetime | None) -> str:
    """`2026-05-01 10:00 UTC`."""
    return f"{time.astimezone(UTC):%Y-%m-%d %H:%M} UTC" if time else "time not recorded"


def kilonewtons(interval: Interval) -> Interval:
    return interval.scaled(1e-3)


def hanger_name(hanger_id: int, name: str) -> str:
    return f"Hanger {hanger_id} ({name})" if name else f"Hanger {hanger_id}"


def quantity(name: str) -> str:
    """`transverse_end_stiffness` as `transverse end stiffness`."""
    return name.replace("_", " ")


def meaning(name: str, model: str) -> str:
    """What a parameter is, with its unit: beams have rotational springs, solids springs a node."""
    if not name.startswith("log10_k"):
        return _MEANINGS.get(name, name)
    spring = name.removeprefix("log10_")
    if model.startswith("beam"):
        return f"log10 of end stiffness {spring} ({_ROTATIONAL_SPRINGS[spring]}) in N m/rad"
    return f"log10 of spring {spring} ({_FACE_SPRINGS[spring]}) in N/m per node"
