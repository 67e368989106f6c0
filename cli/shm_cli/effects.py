"""`shm gap effects`: the catalogue of effects."""

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
from shm_cli.common import show, show_rows
from shm_cli.terminal import Terminal

_HANGER = replace(load_hanger(example.HANGER_FILE), plate=None)

# Two tests that differ in all that an effect may follow, and one that shows the least.
_EVERYTHING = Survey(("t1", "t2"), PLANES, (1.2, 2.4, 3.6), True, (5.0, 20.0), (0.5, 1.0), ())
_LEAST = Survey(("t1",), PLANES[:1], (), False, (), (), ())

OVERVIEW_HEADS = ("effect", "what it is", "shown by")
PARAMETER_HEADS = ("parameter", "unit", "from", "to", "prior", "vanishes at", "why")


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
        _print(f"## {name}\n\n{what(chosen[0])}")
        rows = parameter_rows(list(parameters(chosen[0]).values()))
        _print_table(PARAMETER_HEADS, rows)
        _print(facts(chosen[0]))
    else:
        _print_table(OVERVIEW_HEADS, [(e.name, e.title.lower(), shown_by(e)) for e in chosen])


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
        "what": what(effect),
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
            for each in parameters(effect).values()
        ],
        "source": effect.source,
    }


def what(effect: Effect) -> str:
    return inspect.getdoc(type(effect)) or effect.title


def shown_by(effect: Effect) -> str:
    return ", ".join(effect.seen_by)


def facts(effect: Effect) -> str:
    """Return lines on an effect: place, evidence, imitators and source."""
    places = ", ".join(f"*{each.at}*" for each in effect.variants(_HANGER, _EVERYTHING))
    needs = effect.invisible(_HANGER, _LEAST)
    lines = [
        f"- Where: {places}.",
        f"- Shown by: {shown_by(effect)}." + (f" {needs}" if needs else ""),
        f"- Easily taken for: {', '.join(f'`{name}`' for name in effect.imitated_by)}.",
        f"- Source: {effect.source}",
    ]
    return "\n".join(lines)


def parameters(effect: Effect) -> dict[str, Parameter]:
    """Return the parameters of all its variants by name, on hanger 3."""
    return {
        parameter.name: parameter
        for variant in effect.variants(_HANGER, _EVERYTHING)
        for parameter in effect.parameters(_HANGER, variant)
    }


def parameter_rows(parameters: Sequence[Parameter]) -> list[tuple[str, ...]]:
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
