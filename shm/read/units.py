"""Units of force and acceleration, and their factors to N and m/s^2."""

from __future__ import annotations

import re
from dataclasses import dataclass

from shm.values import Quantity


@dataclass(frozen=True)
class Unit:
    """What a unit measures, and how many N or m/s^2 it is."""

    quantity: Quantity
    si: float


_STANDARD_GRAVITY = 9.80665  # 3rd CGPM (1901)
_METRE_PER_S2 = Unit("acceleration", 1.0)
# NIST Special Publication 811, B.8; a pound is 0.45359237 kg
_UNITS: dict[str, Unit] = {
    "n": Unit("force", 1.0),
    "newton": Unit("force", 1.0),
    "newtons": Unit("force", 1.0),
    "dan": Unit("force", 10.0),
    "kn": Unit("force", 1e3),
    "kgf": Unit("force", _STANDARD_GRAVITY),
    "lbf": Unit("force", 0.45359237 * _STANDARD_GRAVITY),
    "m/s2": _METRE_PER_S2,
    "m/s/s": _METRE_PER_S2,
    "m/sec2": _METRE_PER_S2,
    "ms-2": _METRE_PER_S2,
    "cm/s2": Unit("acceleration", 1e-2),
    "mm/s2": Unit("acceleration", 1e-3),
    "um/s2": Unit("acceleration", 1e-6),
    "g": Unit("acceleration", _STANDARD_GRAVITY),
    "mg": Unit("acceleration", 1e-3 * _STANDARD_GRAVITY),
    "ug": Unit("acceleration", 1e-6 * _STANDARD_GRAVITY),
}
KNOWN = "N, daN, kN, lbf for forces; m/s2, mm/s2, um/s2, g, mg for accelerations"
ACCELERANCE = "m/s2/N"
SI: dict[Quantity, str] = {"force": "N", "acceleration": "m/s2"}


def unit_of(text: str) -> Unit | None:
    """The unit that a text means, None where it is not known."""
    plain = text.lower().replace("²", "2").replace("µ", "u").replace("μ", "u")
    return _UNITS.get(re.sub(r"[\s\[\]()^*]", "", plain))


def accelerance_si(numerator: str, denominator: str) -> float | None:
    """Factor to m/s^2/N of response over force; "" means SI; None where a unit is not known.

    The numerator may also hold the whole fraction, as in "(m/s2)/N" or an analyser's "(m/s2)(N)".
    """
    numerator = numerator.replace(")(", ")/(")
    if not denominator and unit_of(numerator) is None and "/" in numerator:
        numerator, _, denominator = numerator.rpartition("/")
    above = unit_of(numerator or SI["acceleration"])
    below = unit_of(denominator or SI["force"])
    if above is None or below is None:
        return None
    right = above.quantity == "acceleration" and below.quantity == "force"
    return above.si / below.si if right else None
