"""Makes docs/effects.md from the catalogue of effects."""

from __future__ import annotations

import inspect
import math

from shm.models.effects import EFFECTS, Effect, Parameter, Survey
from shm.values import PLANES, Hanger

_AREA_M2 = math.pi * 0.130**2 / 4
_HANGER = Hanger(
    id=3,
    length_m=12.0,
    elastic_modulus_pa=200e9,
    area_m2=_AREA_M2,
    second_moment_m4=math.pi * 0.130**4 / 64,
    mass_per_length_kg_m=7800 * _AREA_M2,
    nominal_tension_n=711e3,
    diameter_m=0.130,
)
_EVERYTHING = Survey(("t1", "t2"), PLANES, (1.2, 2.4, 3.6), True, (5.0, 20.0), (0.5, 1.0), ())
_LEAST = Survey(("t1",), PLANES[:1], (), False, (), (), ())

_HEAD = """# Catalogue of effects

Made by `make docs` from `shm/models/effects/`. These are the physical effects that
`shm gap diagnose` knows: what can make a hanger differ from the model of it, each a term of the
general hanger model that vanishes at one value of its first parameter, its *size*.

Priors are deliberately wide, because nobody knows the order of magnitude beforehand: most sizes are
logarithmic, *either sign* means that the effect may raise or lower. Lengths, masses and stiffnesses
are scaled by the hanger's own; the numbers below are those of
[hanger 3](hangers.md#round-bar-with-end-plates). You know your bridge better: narrow any range in
`bridge.toml`, see [hangers.md](hangers.md#ranges-of-effects).

An effect that your measurements cannot show is not tried, and the diagnosis says why. One that they
show but cannot tell from another is reported as a group with it; *easily taken for* lists what to
think of then. What imitates what:

- More mass along the hanger, less bending stiffness and a slow clock give the same frequencies and
  shapes once the tension is free. A known mass clamped on for one test tells the mass from the
  other two; no hammer test tells stiffness from clock: hold the logger against another clock.
  Effective length and stiff end zones come near to them in frequencies; shapes separate them.
- A stiff end spring k and a bar that is longer by EI/k are the same to first order, in frequencies
  and in shapes; so are a short stiff zone and a bar that is shorter by about its length.
- Changes of mass, stiffness or length below 1 to 2 % lie within what a bar as made differs from its
  description (`[hanger.scatter]`) and are no gap.
- Turned sensors show in shapes only; effects of temperature and level only in tests that vary them,
  and only apart where the warm tests are not the hard ones too.
- Joints that soften or lie askew pass for plain end flexibility where the level is not varied, or
  the sensors see one plane only.
- A small mass close to an end, an end that gives way sideways, and shear with rotary inertia all
  lower the high orders alike.
- Frequencies of a uniform hanger cannot tell its two ends apart: deck end and arch end, or a place
  and its mirror image, need shapes or a known mass.
"""


def effects_page() -> str:
    """The page of all effects, in the order of the catalogue."""
    parts = [_HEAD + "\n" + _overview()] + [_section(effect) for effect in EFFECTS.values()]
    return "\n\n".join(parts) + "\n"


def _overview() -> str:
    head = "| effect | what it is | shown by |\n|---|---|---|\n"
    rows = (
        f"| [`{name}`](#{name}) | {effect.title.lower()} | {', '.join(effect.seen_by)} |"
        for name, effect in EFFECTS.items()
    )
    return head + "\n".join(rows)


def _section(effect: Effect) -> str:
    variants = effect.variants(_HANGER, _EVERYTHING)
    found = {
        parameter.name: parameter
        for variant in variants
        for parameter in effect.parameters(_HANGER, variant)
    }
    places = ", ".join(f"*{variant.at}*" for variant in variants)
    needs = effect.invisible(_HANGER, _LEAST)
    lines = [
        f"## {effect.name}",
        inspect.getdoc(type(effect)) or effect.title,
        _table(list(found.values())),
        f"- Where: {places}.",
        f"- Shown by: {', '.join(effect.seen_by)}." + (f" {needs}" if needs else ""),
        f"- Easily taken for: {', '.join(f'`{name}`' for name in effect.imitated_by)}.",
        f"- Source: {effect.source}",
    ]
    if effect.other_laws:
        lines.append(
            f"- Or by another law, which the diagnosis allows for: {'; '.join(effect.other_laws)}."
        )
    return "\n\n".join(lines[:3]) + "\n\n" + "\n".join(lines[3:])


def _table(parameters: list[Parameter]) -> str:
    """One row a parameter; those of the other end or plane, which only repeat it, in one row."""
    titles = "| parameter | unit | from | to | prior | vanishes at | why |\n"
    head = titles + "|---|---|---|---|---|---|---|\n"
    alike: dict[tuple[float, float, str], list[Parameter]] = {}
    for parameter in parameters:
        key = (parameter.lower, parameter.upper, parameter.reason)
        alike.setdefault(key, []).append(parameter)
    return head + "\n".join(_row(group) for group in alike.values())


def _row(group: list[Parameter]) -> str:
    names = ", ".join(f"`{parameter.name}`" for parameter in group)
    one = group[0]
    zero = "" if math.isnan(one.zero) else f"{one.zero:g}"
    cells = (names, one.unit, f"{one.lower:.4g}", f"{one.upper:.4g}", _prior(one), zero, one.reason)
    return "| " + " | ".join(cells) + " |"


def _prior(parameter: Parameter) -> str:
    spread = "uniform in log10" if parameter.name.startswith("log10_") else parameter.spread
    return f"{spread}, either sign" if parameter.signed else spread
