"""The law of something unknown as the file of a new effect, which a person can adopt.

The file is a start: it holds the law as found. Whoever learns what causes it puts the mechanism in
its place.
"""

from __future__ import annotations

import math

from shm.errors import NothingThere
from shm.report.diagnosis_remainder import law
from shm.report.formatting import hanger_name
from shm.values import PLANES, Diagnosis, Hanger, LawTerm

_HEAD = '''"""{said}

Found by `shm gap diagnose` on {hanger}; {tests}. A law, not yet a
mechanism: put the mechanism here once it is known.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.models.effects import Conditions, Effect, Parameter, Survey, Variant
from shm.models.hanger import ModeLaw, PhysicalHanger
from shm.values import FloatArray, Hanger


class FoundLaw(Effect):
    """{said}"""

    name = "{name}"
    title = "A law found where nothing of the catalogue fits"
    phrase = "a law found on another hanger, of {{{first}}}"
    source = "shm gap diagnose, {hanger}."
    seen_by = ({seen_by},)
    imitated_by = ()
    follows = ({follows})

    def invisible(self, hanger: Hanger, survey: Survey) -> str:
{invisible}        return ""

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        return (
{parameters}        )

    def applied(
        self,
        physical: PhysicalHanger,
        values: FloatArray,
        variant: Variant,
        conditions: Conditions,
        hanger: Hanger,
    ) -> PhysicalHanger:
        laws = (
{laws}        )
        return replace(physical, mode_laws=(*physical.mode_laws, *laws))


EFFECT = FoundLaw()
'''
_PARAMETER = """            Parameter(
                "{name}",
                "{unit}",
                {lower:.3g},
                {upper:.3g},
                0.0,
                "A hundredth to ten times what was found first, {found:.3g}, either way.",
                spread="logarithmic",
                signed=True,
            ),
"""
_LAW = """            ModeLaw(
                values[:, {column}, None] * np.array([{planes}]) * {tests},
                lambda order: {orders},
            ),
"""
_ORDERS = {
    "even": "np.ones_like(order)",
    "order": "order",
    "order squared": "order**2",
    "alternating": "np.where(order % 2 == 1, 1.0, -1.0)",
    "lowest orders": "order**-2.0",
}
_WARM = """        if not survey.temperatures_c or np.ptp(survey.temperatures_c) < 1.0:
            return "It takes tests at two known temperatures at least 1 K apart."
"""
_LEVELS = """        levels = survey.amplitudes
        if not levels or max(levels) < 1.2 * min(levels):
            return "It takes tests at two known levels, one at least 1.2 times the other."
"""


def effect_file(diagnosis: Diagnosis, hanger: Hanger, name: str) -> str:
    """The module of an effect `name`; raises NothingThere where no law was found."""
    found = diagnosis.remainder
    if found is None or not found.law:
        raise NothingThere(
            "these data show no law of something unknown, so that there is no effect to write.",
            remedy="Leave out --write-effect, or give more tests and modes.",
        )
    kinds = {term.over_tests for term in found.law}
    warm, level = "temperature" in kinds, bool(kinds - {"temperature", "all tests"})
    follows = [each for each, on in (("temperature", warm), ("amplitude", level)) if on]
    numbered = list(enumerate(found.law))
    return _HEAD.format(
        said=_wrapped(law(found)),
        hanger=hanger_name(hanger.id, hanger.name),
        tests=f"{len(diagnosis.tests)} tests, baseline {diagnosis.baseline}",
        name=name,
        first=_parameter(0),
        seen_by=", ".join(repr(f"tests at different {_SEEN[each]}") for each in follows)
        or '"frequencies"',
        follows="".join(f'"{each}", ' for each in follows).strip(),
        invisible=(_WARM if warm else "") + (_LEVELS if level else ""),
        parameters="".join(_prior(number, term) for number, term in numbered),
        laws="".join(_law(number, term, hanger) for number, term in numbered),
    )


_SEEN = {"temperature": "temperatures", "amplitude": "levels"}


def _wrapped(text: str) -> str:
    """Its first clause, which heads a docstring."""
    return text.partition(" (")[0] + "."


def _parameter(number: int) -> str:
    return f"size_{number + 1}"


def _prior(number: int, term: LawTerm) -> str:
    size = abs(term.coefficient)
    unit = "1/K" if term.over_tests == "temperature" else "fraction"
    return _PARAMETER.format(
        name=_parameter(number), unit=unit, lower=size / 100, upper=10 * size, found=size
    )


def _law(number: int, term: LawTerm, hanger: Hanger) -> str:
    tests = {
        "all tests": "1.0",
        "temperature": "conditions.temperature_shift_k",
        "level": "conditions.amplitude",
        "level squared": "conditions.amplitude**2",
        "above a level": f"float(conditions.amplitude > {term.threshold:.4g})",
    }[term.over_tests]
    share = 0.0 if math.isnan(term.x_m) else term.x_m / hanger.length_m
    return _LAW.format(
        column=number,
        planes=", ".join("1.0" if plane in term.planes else "0.0" for plane in PLANES),
        tests=tests,
        orders=_ORDERS.get(term.over_orders, f"np.sin(order * np.pi * {share:.4g}) ** 2"),
    )
