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
    "kp": Unit("force", _STANDARD_GRAVITY),
    "mn": Unit("force", 1e-3),
    "kilonewton": Unit("force", 1e3),
    "lb": Unit("force", 0.45359237 * _STANDARD_GRAVITY),
    "lbf": Unit("force", 0.45359237 * _STANDARD_GRAVITY),
    "m/s2": _METRE_PER_S2,
    "m/s/s": _METRE_PER_S2,
    "m/sec2": _METRE_PER_S2,
    "ms-2": _METRE_PER_S2,
    "meter/s2": _METRE_PER_S2,
    "m/second2": _METRE_PER_S2,
    "ft/s2": Unit("acceleration", 0.3048),
    "in/s2": Unit("acceleration", 0.0254),
    "cm/s2": Unit("acceleration", 1e-2),
    "mm/s2": Unit("acceleration", 1e-3),
    "um/s2": Unit("acceleration", 1e-6),
    "g": Unit("acceleration", _STANDARD_GRAVITY),
    "gn": Unit("acceleration", _STANDARD_GRAVITY),
    "gs": Unit("acceleration", _STANDARD_GRAVITY),
    "g's": Unit("acceleration", _STANDARD_GRAVITY),
    "mg": Unit("acceleration", 1e-3 * _STANDARD_GRAVITY),
    "ug": Unit("acceleration", 1e-6 * _STANDARD_GRAVITY),
}
KNOWN = "N, daN, kN, lbf for forces; m/s2, mm/s2, um/s2, g, mg for accelerations"
ACCELERANCE = "m/s2/N"
UNSAID = "unknown"
"""The unit of a channel whose file says none, where its name alone promises nothing."""
SI: dict[Quantity, str] = {"force": "N", "acceleration": "m/s2"}


def unit_of(text: str) -> Unit | None:
    """The unit that a text means, None where it is not known."""
    if text.strip() == "MN":  # the one unit of which the capital letter decides
        return Unit("force", 1e6)
    return _UNITS.get(plain_unit(text))


def plain_unit(text: str) -> str:
    """A unit in small letters, without brackets, blanks and signs of powers and products.

    "Â²" is a ² that was decoded twice, U+FFFD one that was lost.
    """
    plain = text.lower().replace("â²", "2").replace("²", "2").replace("m/s\ufffd", "m/s2")
    plain = plain.replace("µ", "u").replace("μ", "u")
    return re.sub(r"[\s\[\]()^*·⋅]", "", plain)


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
