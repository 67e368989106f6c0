"""`shm gap effects`: the catalogue of effects, which is also the manual's page of them."""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import replace

import rich_click as click
from rich.markdown import Markdown

from shm.bridge import load_hanger
from shm.models.effects import EFFECTS, Effect, Parameter, Survey
from shm.values import PLANES
from shm.values.parameter_names import is_logarithm
from shm_cli import completion, example, flags
from shm_cli.common import markdown, show, show_rows
from shm_cli.terminal import Terminal

_HANGER = replace(load_hanger(example.HANGER_FILE), plate=None)

# Two tests that differ in all that an effect may follow, and one that shows the least.
_EVERYTHING = Survey(("t1", "t2"), PLANES, (1.2, 2.4, 3.6), True, (5.0, 20.0), (0.5, 1.0), ())
_LEAST = Survey(("t1",), PLANES[:1], (), False, (), (), ())

_OVERVIEW_HEADS = ("effect", "what it is", "shown by")
_PARAMETER_HEADS = ("parameter", "unit", "from", "to", "prior", "vanishes at", "why")
_HEAD = """# Catalogue of effects

These are the physical effects that `shm gap diagnose` knows: what can make a hanger differ from
the model of it, each a term of the general hanger model that vanishes at one value of its first
parameter, its *size*.

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


@click.command()
@click.argument(
    "name",
    required=False,
    metavar="[EFFECT]",
    type=click.Choice(list(EFFECTS)),
    shell_complete=completion.effects,
)
@flags.json
def effects(name: str | None) -> None:
    """List the catalogue of effects: ranges, evidence and imitators of each.

    The ranges are those of hanger 3 of the thesis, since they scale with the hanger.

    \b
    Example: shm gap effects point_mass
    """
    chosen = [EFFECTS[name]] if name else list(EFFECTS.values())
    if flags.wants_json():
        show({"effects": [_document(effect) for effect in chosen]})
        return
    if name:
        _print(f"## {name}\n\n{_what(chosen[0])}")
        rows = _parameter_rows(list(_parameters(chosen[0]).values()))
        _print_table(_PARAMETER_HEADS, rows)
        _print(_facts(chosen[0]))
    else:
        _print(_HEAD)
        _print_table(_OVERVIEW_HEADS, [(e.name, e.title.lower(), _shown_by(e)) for e in chosen])


def _print(text: str) -> None:
    """Print Markdown in a terminal, without the targets of links."""
    Terminal().print(Markdown(re.sub(r"\[([^\]]+)\]\([^)]+\)", r"\1", text)))


def _print_table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    show_rows("", heads, [[cell.replace("`", "") for cell in row] for row in rows])


def _document(effect: Effect) -> dict[str, object]:
    """Return one effect for JSON: names, texts, and each parameter once."""
    return {
        "effect": effect.name,
        "title": effect.title,
        "what": _what(effect),
        "shown_by": list(effect.seen_by),
        "imitated_by": list(effect.imitated_by),
        "places": [variant.at for variant in effect.variants(_HANGER, _EVERYTHING)],
        "parameters": [
            {
                "name": each.name,
                "unit": each.unit,
                "from": each.lower,
                "to": each.upper,
                "prior": _prior(each),
                "why": each.reason,
            }
            for each in _parameters(effect).values()
        ],
        "source": effect.source,
    }


def effects_page() -> str:
    """Return the page of all effects in Markdown, in the order of the catalogue."""
    rows = [(f"[`{e.name}`](#{e.name})", e.title.lower(), _shown_by(e)) for e in EFFECTS.values()]
    parts = [_HEAD + "\n" + markdown(_OVERVIEW_HEADS, rows)]
    return "\n\n".join(parts + [_section(effect) for effect in EFFECTS.values()]) + "\n"


def _section(effect: Effect) -> str:
    parameters = markdown(_PARAMETER_HEADS, _parameter_rows(list(_parameters(effect).values())))
    return "\n\n".join([f"## {effect.name}", _what(effect), parameters, _facts(effect)])


def _what(effect: Effect) -> str:
    return inspect.getdoc(type(effect)) or effect.title


def _shown_by(effect: Effect) -> str:
    return ", ".join(effect.seen_by)


def _facts(effect: Effect) -> str:
    """Return lines on an effect: place, evidence, imitators and source."""
    places = ", ".join(f"*{each.at}*" for each in effect.variants(_HANGER, _EVERYTHING))
    needs = effect.invisible(_HANGER, _LEAST)
    lines = [
        f"- Where: {places}.",
        f"- Shown by: {_shown_by(effect)}." + (f" {needs}" if needs else ""),
        f"- Easily taken for: {', '.join(f'`{name}`' for name in effect.imitated_by)}.",
        f"- Source: {effect.source}",
    ]
    if effect.other_laws:
        lines.append(f"- A real one may follow another law: {'; '.join(effect.other_laws)}.")
    return "\n".join(lines)


def _parameters(effect: Effect) -> dict[str, Parameter]:
    """Return the parameters of all its variants by name, on hanger 3."""
    return {
        parameter.name: parameter
        for variant in effect.variants(_HANGER, _EVERYTHING)
        for parameter in effect.parameters(_HANGER, variant)
    }


def _parameter_rows(parameters: Sequence[Parameter]) -> list[tuple[str, ...]]:
    """Return one row a parameter; equal ones of the other end or plane share it."""
    same_prior: dict[tuple[float, float, str], list[Parameter]] = {}
    for parameter in parameters:
        key = (parameter.lower, parameter.upper, parameter.reason)
        same_prior.setdefault(key, []).append(parameter)
    return [_row(group) for group in same_prior.values()]


def _row(group: list[Parameter]) -> tuple[str, ...]:
    names = ", ".join(f"`{parameter.name}`" for parameter in group)
    one = group[0]
    zero = "" if math.isnan(one.zero) else f"{one.zero:g}"
    return (names, one.unit, f"{one.lower:.4g}", f"{one.upper:.4g}", _prior(one), zero, one.reason)


def _prior(parameter: Parameter) -> str:
    spread = "uniform in log10" if is_logarithm(parameter.name) else parameter.spread
    return f"{spread}, either sign" if parameter.signed else spread
