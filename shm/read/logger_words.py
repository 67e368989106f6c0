"""Interpret the words of loggers in German and English: units, names, keys of preambles.

The unit decides: a column is a force because it is in newtons. A name decides only where the unit
is one of volts, and then only which sensor to ask for.

Units of force and acceleration have their factors to N and m/s^2 here.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

from shm.values import Plane, Quantity


@dataclass(frozen=True)
class Unit:
    """Hold the quantity that a unit measures, and its factor to N or m/s^2."""

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
UNIT_MISSING = "unknown"
"""The unit of a channel whose file says none, where its name alone promises nothing."""
SI: dict[Quantity, str] = {"force": "N", "acceleration": "m/s2"}


def unit_of(text: str) -> Unit | None:
    """Return the unit that a text means, None where it is not known."""
    if text.strip() == "MN":  # the one unit of which the capital letter decides
        return Unit("force", 1e6)
    return _UNITS.get(plain_unit(text))


def plain_unit(text: str) -> str:
    """Return a unit in small letters, without brackets, blanks and signs of powers and products.

    "Â²" is a ² that was decoded twice, U+FFFD one that was lost.
    """
    plain = text.lower().replace("â²", "2").replace("²", "2").replace("m/s\ufffd", "m/s2")
    plain = plain.replace("µ", "u").replace("μ", "u")
    return re.sub(r"[\s\[\]()^*·⋅]", "", plain)


def accelerance_si(numerator: str, denominator: str) -> float | None:
    """Return the factor of response over force to m/s^2/N; None where a unit is unknown, "" is SI.

    The numerator may also be a complete fraction, as in "(m/s2)/N" or an analyser's
    "(m/s2)(N)".
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


def is_accelerance(unit: str) -> bool:
    """Return whether a unit is one of acceleration over force."""
    return "/" in unit.replace(")(", ")/(") and accelerance_si(unit, "") is not None


# In s and in V; a day has 86,400 s.
_SECONDS = {
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds", "sek", "sekunden"), 1.0),
    **dict.fromkeys(("ms", "msec", "millisecond", "milliseconds", "millisekunden"), 1e-3),
    **dict.fromkeys(("us", "usec", "microseconds", "mikrosekunden"), 1e-6),
    **dict.fromkeys(("min", "minutes", "minuten"), 60.0),
    **dict.fromkeys(("h", "hours", "stunden"), 3600.0),
    **dict.fromkeys(("d", "days", "tage"), 86400.0),
}
_VOLTS = {**dict.fromkeys(("v", "volt", "volts"), 1.0), "mv": 1e-3, "uv": 1e-6}
# What loggers measure besides: known so that a row of them is seen to be a row of units.
_OTHERS = {
    "", "-", "--", "1", "°c", "degc", "c", "k", "°f", "°", "deg", "rad", "%", "mm", "cm", "m", "um",
    "um/m", "ue", "mm/m", "mv/v", "hz", "khz", "rpm", "1/min", "m/s", "mm/s", "cm/s", "bar", "mbar",
    "pa", "kpa", "mpa", "n/mm2", "nm", "knm", "a", "ma", "ohm", "db", "counts", "count", "digit",
    "digits", "lsb", "fs", "fullscale", "a.u.", "%rh", "kg", "none", "yyyy-mm-dd", "hh:mm:ss",
    "ts", "rn", "smp", "dd.mm.yyyy", "hh:mm:ss.000", "hh:mm:ss,000",
}  # fmt: skip
_BRACKETED = re.compile(
    r"\s*(?:\[([^\[\]]*)\]|\(([^()]*(?:\([^()]*\))?[^()]*)\)|<([^<>]*)>|\{([^{}]*)\})\s*$"
)
_APART = re.compile(r"\s*(/| in |,|:|_| )\s*")
_TIMES = re.compile(
    r"(t|x|x[ _]?(value|werte?|achse|axis)|(rel(ative|ativ)?|elapsed|abs(olute?)?)?[ _.]*"
    r"(time|zeit|zeitkanal|zeitachse)([ _]?(stamp|stempel|axis|channel|s|ms))?([ _]*\d)?|datum|date"
    r"|uhrzeit|timestamp|zeitstempel|(date|datum)[ _/&-]*(time|zeit|uhrzeit)|elapsed|sekunden"
    r"|seconds)([ _]*[-.]?[ _]*.*(rate|messrate).*)?",
    re.IGNORECASE,
)
_COUNTERS = re.compile(
    r"(n|nr|no|nummer|number|index|idx|i|#|sample|samples|sweeps?|scan|scans|zeile|row|record|punkt|point|"
    r"sample ?(no|nr|number|index)|mess(wert|punkt)( ?nr)?|lfd ?nr|count|counter|z(ä|ae)hler)\.?",
    re.IGNORECASE,
)
_FORCE = re.compile(
    r"force|kraft|hammer|impact|impuls|schlag|\bf(_?\d|[xyz])?\b|load", re.IGNORECASE
)
_ACCELERATION = re.compile(
    r"acc|beschl|\ba(_?\d+)?_?[xyz]?\b|\bb\d+\b|vibration|schwing|acz|\bicp|iepe", re.IGNORECASE
)
_SIZE = re.compile(r"\babsolute? (acc|beschl)|magnitude|betrag|resultant|resultier", re.IGNORECASE)
_TRANSVERSE = re.compile(r"transv|\bquer|_quer|querricht|lateral", re.IGNORECASE)
_LONGITUDINAL = re.compile(r"longit|l(ä|ae)ngs", re.IGNORECASE)
_SENSITIVITY = re.compile(
    r"([+-]?\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?)\s*([mµμu]?)V\s*/\s*\(?\s*([^\s()\[\]]+(?:\s*\^?\s*2)?)\s*\)?"
)


@dataclass(frozen=True)
class Sensitivity:
    """Hold a sensor's sensitivity: `unit_per_volt` of `unit`, such as 10 g per volt at 100 mV/g."""

    unit: str
    unit_per_volt: float


def sensitivity_of(text: str) -> Sensitivity | None:
    """Return the sensitivity of a text such as "100 mV/g" or "2,25 mV/N"; None for another text."""
    found = _SENSITIVITY.fullmatch(text.strip().strip("[]"))
    if found is None or unit_of(found[3]) is None:
        return None
    volts = float(found[1].replace(",", ".")) * {"": 1.0, "m": 1e-3}.get(found[2], 1e-6)
    return Sensitivity(found[3].strip(), 1 / volts) if volts else None


def volts_of(unit: str) -> float | None:
    """Return the size of a unit in volts; None where it is none of voltage."""
    return _VOLTS.get(plain_unit(unit))


def seconds_of(unit: str) -> float | None:
    """Return the size of a unit in seconds; None where it is none of time."""
    return _SECONDS.get(plain_unit(unit))


def is_unit(text: str) -> bool:
    """Return whether a text is a unit of anything that loggers measure."""
    plain = plain_unit(text)
    known = plain in _SECONDS or plain in _VOLTS or plain in _OTHERS
    return known or unit_of(text) is not None or sensitivity_of(text) is not None


def name_and_unit(text: str) -> tuple[str, str]:
    """Return the name of a column and its unit, "" where the text has none.

    "Kraft [N]", "Force (N)", "Acc / g", "a in m/s²" and "acc_1_g" have one; "Acc (top)" has
    not.
    """
    text = " ".join(text.split())
    found = _BRACKETED.search(text)
    if found is not None:
        unit = next(part for part in found.groups() if part is not None).strip()
        name = text[: found.start()].strip()
        if name and found[2] is not None and unit.isdecimal():
            return text, ""  # Acc_Z(1): an element of an array
        if is_unit(unit):
            return name, unit
        inner = name_and_unit(name) if name else ("", "")
        return (f"{inner[0]} {found[0].strip()}", inner[1]) if inner[1] else (text, "")
    for mark in _APART.finditer(text):
        if mark.start() and _is_unit_mark(mark[1], text[mark.end() :]):
            return text[: mark.start()], text[mark.end() :]
    return text, ""


def _is_unit_mark(mark: str, unit: str) -> bool:
    """Return whether the end of a name is a unit; after a blank or underscore only a clear one."""
    known = unit_of(unit) is not None or volts_of(unit) is not None
    if mark in ("_", " ", ":"):  # a letter there may be a direction or a number
        return known or plain_unit(unit) in ("ms", "sec")
    return known or seconds_of(unit) is not None


def quantity_meant(name: str) -> Quantity | None:
    """Return the quantity that a column's name probably means; None where it means none."""
    if _FORCE.search(name) and not _ACCELERATION.match(name):
        return "force"
    return "acceleration" if _ACCELERATION.search(name) else None


def means_force_alone(name: str) -> bool:
    """Return whether a name is that of a force, and holds no word of acceleration."""
    return _FORCE.search(name) is not None and _ACCELERATION.search(name) is None


def means_no_axis(name: str) -> bool:
    """Return whether a name is that of the size of an acceleration, whose sign is lost."""
    return _SIZE.search(name) is not None and re.search(r"\b[xyz]\b", name, re.IGNORECASE) is None


def plane_meant(name: str) -> Plane | None:
    """Return the plane that a name gives in words; None for the letter of an axis or no plane."""
    if _TRANSVERSE.search(name):
        return "transverse"
    return "longitudinal" if _LONGITUDINAL.search(name) else None


def means_time(name: str) -> bool:
    """Return whether a name is that of a column of times."""
    return _TIMES.fullmatch(name.strip()) is not None


def means_counter(name: str) -> bool:
    """Return whether a name is that of a column that counts the samples."""
    return _COUNTERS.fullmatch(name.strip()) is not None


# ---------------------------------------------------------------- preambles


def key_of(text: str) -> str:
    """Return a key of a preamble by its letters alone, in lower case."""
    return "".join(c for c in text.lower() if c.isalpha())


def _meaning(letters: str) -> Callable[[str], bool]:
    """Return a test of whether the letters of a key belong to one meaning."""
    meant = re.compile(letters)
    return lambda key: meant.fullmatch(key_of(key)) is not None


means_rate = _meaning(
    r"(standard)?(abtast|mess|sample|sampling|samples?|scan|data|acquisition|aufnahme|daq)?"
    r"(ing)?(rate|frequenz|frequency|freq)(hz)?|fs|sps|samplespersec(ond)?|abtastratehz|fabtast"
)
means_interval = _meaning(
    r"delta[xt]|(x(axis)?)?delta|dt|xinc(rement)?|wfincrement|(abtast|sampling|sample|scan|mess|time|zeit)"
    r"(intervall?|period|periode|step|schritt|schrittweite|zeit|inkrement|increment)|schrittweite"
)
means_date = _meaning(
    r"(mess|test|start|aufnahme|record(ing|ed)?|acquisition|trigger|creation)?(datum|date)"
)
means_moment = _meaning(
    r"(mess|test|start|aufnahme|record(ing|ed)?|acquisition|trigger|begin(n)?|created?)*"
    r"(zeit|times?|uhrzeit|zeitpunkt|beginn|begin|start|datetime|datumzeit|datumuhrzeit|dateandtime"
    r"|datetimestamp|dateutc|timeutc|recorded|acquired|on|am|ed)(utc)?"
)
means_temperature = _meaning(
    r"(bauteil|stahl|luft|umgebungs|steel|air|ambient|hanger)?temp(eratur|erature)?(c|degc)?"
)
means_hanger = _meaning(
    r"h(a|ä|ae)nger(nr|no|nummer|number|id)?|seil(nr|nummer)?|cable(no|number)?"
)
_OF_HANGER = re.compile(
    r"steel|stahl|bauteil|h(a|ä|ae)nger|cable|seil|surface|oberfl|(air|luft|ambient|umgebung)", re.I
)


def temperature_meant(name: str) -> int:
    """Return how well a column of degrees tells the hanger's: 2 its steel, 1 the air, 0 neither."""
    found = _OF_HANGER.search(name)
    return 0 if found is None else 1 if found[2] else 2


def is_celsius(unit: str) -> bool:
    """Return whether a unit is degrees Celsius."""
    return plain_unit(unit) in ("°c", "degc", "degreesc", "celsius", "c")


_NUMBERED = re.compile(
    r"(?:h(?:a|ä|ae)nger|seil|cable)\s*(?:nr\.?|no\.?|#)?[\s_:=-]*0*(\d{1,3})(?!\d|[.-]\d)",
    re.IGNORECASE,
)
means_title = _meaning(r"(title|titel|signal|channel|kanal)(name)?")
means_unit = _meaning(r"y?(axis|achse)?(unit|einheit)(label)?")
means_serial = _meaning(r".*(serial|serien|^sn)(number|nummer|nr|no)?.*")


def hanger_numbered(text: str) -> int | None:
    """Return the hanger number in a text or file name, as "Hänger 3"; None where none or two."""
    found = {int(number) for number in _NUMBERED.findall(text)}
    return found.pop() if len(found) == 1 else None
