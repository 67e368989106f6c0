"""From which size on a gap diagnosis would find each effect."""

from __future__ import annotations

from dataclasses import dataclass

from shm.report import formatting
from shm.report.figures import specification as spec
from shm.report.gap_check_report import HEADINGS, found_from, rows, size_words, sound_words
from shm.values import EffectCheck, GapCheck
from shm.values.gap_check import Outcome


@dataclass(frozen=True)
class _Look:
    """The marks of trials with some outcomes."""

    outcomes: tuple[Outcome, ...]
    name: str
    colour: str
    symbol: spec.Symbol
    filled: bool = True


_LOOKS = (
    _Look(("alone",), "found alone", "green", "circle"),
    _Look(("in a group",), "found with others", "blue", "square"),
    _Look(("another cause",), "taken for another", "orange", "triangle"),
    _Look(("unexplained", "refused"), "something unknown", "red", "cross"),
    _Look(("no gap",), "not visible", "quiet", "circle", filled=False),
)


def specify(check: GapCheck) -> spec.Specification | None:
    """Return effects as rows, sizes from weakest to strongest, a mark for each diagnosis."""
    if not check.effects:
        return None
    places = range(len(check.effects))
    marks: list[spec.Mark] = []
    for row, effect in enumerate(check.effects):
        if effect.found_from is not None:
            ends = [_place(effect, effect.found_from), 1.0]
            marks.append(spec.Line(x=ends, y=[row, row], colour="green", width=5, opacity=0.25))
    for look in _LOOKS:
        found = [
            (_place(effect, trial.step), _height(check, row, trial.seed), effect, trial.step)
            for row, effect in enumerate(check.effects)
            for trial in effect.trials
            if trial.outcome in look.outcomes
        ]
        if found:
            x, y, effects, steps = zip(*found, strict=True)
            texts = [
                f"{formatting.quantity(e.effect)}, {size_words(e, step)}: {look.name}"
                for e, step in zip(effects, steps, strict=True)
            ]
            marks.append(
                spec.Points(
                    x=x, y=y, colour=look.colour, symbol=look.symbol, filled=look.filled,
                    size=6, name=look.name, texts=texts, clipped=False,
                )
            )  # fmt: skip
    wording = [found_from(each) for each in check.effects]
    marks.append(
        spec.Points(
            x=[1.0 for _ in places],
            y=list(places),
            size=0,
            labels=wording,
            colour="ink",
            clipped=False,
        )
    )
    names = [formatting.quantity(each.effect) for each in check.effects]
    panel = spec.Panel(
        y=spec.Axis(range=(len(places) - 0.4, -0.6), ticks=places, tick_labels=names, grid=False),
        x=spec.Axis(
            label="size, from the weakest to the strongest of its prior range",
            range=(0.0, 1.35), ticks=(0, 0.25, 0.5, 0.75, 1), grid=False,
        ),
        marks=marks,
    )  # fmt: skip
    return spec.stacked([panel], 0.27 * len(places) + 1.3, legend_columns=5)


def _place(effect: EffectCheck, step: int) -> float:
    """Return the place of a size on the axis: its fraction of the prior range."""
    return (step + 0.5) / len(effect.sizes)


def _height(check: GapCheck, row: int, seed: int) -> float:
    """Return the height of a mark, so that those of several seeds lie side by side."""
    return row + 0.5 * ((seed - check.seed + 0.5) / check.seeds - 0.5)


def caption(check: GapCheck) -> str:
    """Explain the figure."""
    return (
        "Each effect was planted in a twin of the hanger and diagnosed. Sizes spread over the "
        "range of its prior; a bar begins at the smallest that is found, which stands at its "
        f"right. {sound_words(check)}"
    ).strip()


def _alt(check: GapCheck) -> str:
    wording = ["; ".join(each for each in row if each) for row in rows(check)]
    return f"{'; '.join(HEADINGS)}: {'. '.join(wording)}."


FIGURE = spec.FigureSpec("gap_check", "What a diagnosis would find", specify, caption, _alt)
