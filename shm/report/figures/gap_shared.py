"""Which hangers have a shared cause, and how large it is in each."""

from __future__ import annotations

from shm.report import formatting
from shm.report.diagnosis_wording import quantity, size
from shm.report.figures.illustration import Member
from shm.report.figures.specification import (
    Axis,
    Band,
    Bars,
    Mark,
    Panel,
    Points,
    Rule,
    Specification,
    stacked,
)
from shm.values import BridgeDiagnosis, effect_label

_INCHES = 4.2  # technical: two panels of the height that others have
_LIKELIER_THAN_NOT = 0.5  # even odds
_MOST_TICKS = 24  # numbers of hangers that a page has room for


def specify(diagnosis: BridgeDiagnosis) -> Specification | None:
    """Above the probability of each hanger to have it, below its size with the family's own."""
    if (leading := diagnosis.leading) is None:
        return None
    at = range(len(leading.members))
    step = 1 + (len(leading.members) - 1) // _MOST_TICKS
    ticks = list(at)[::step]
    labels = [str(leading.members[tick].hanger) for tick in ticks]
    across = Axis(
        label="hanger", range=(-0.7, len(leading.members) - 0.3), ticks=ticks,
        tick_labels=labels, grid=False,
    )  # fmt: skip
    named = [i for i in at if leading.members[i].probability > _LIKELIER_THAN_NOT]
    marks: list[Mark] = []
    for colour, rows in (("blue", named), ("quiet", [i for i in at if i not in named])):
        shares = [leading.members[i].probability for i in rows]
        texts = [
            f"hanger {leading.members[i].hanger}: {leading.members[i].probability:.2f}"
            for i in rows
        ]
        if rows:
            marks.append(Bars(x=rows, y=shares, width=0.62, colour=colour, texts=texts))
    sizes = [leading.members[i].size for i in named]
    common = leading.size
    unit = f" (log10, {common.unit})" if common.name.startswith("log10_") else f" ({common.unit})"
    ends = [-0.7, len(leading.members) - 0.3]
    below = [
        Band(x=ends, low=[common.q05] * 2, high=[common.q95] * 2, colour="orange", opacity=0.25,
             name="the family's own, 90 %"),
        Points(x=named, y=[each.mean for each in sizes], low=[each.q05 for each in sizes],
               high=[each.q95 for each in sizes], colour="blue", name="hanger, 90 %"),
    ]  # fmt: skip
    return stacked(
        [
            Panel(
                y=Axis(label="probability", range=(0, 1.05)),
                marks=[*marks, Rule(at=_LIKELIER_THAN_NOT, dash="dot", colour="ink")],
            ),
            Panel(y=Axis(label=quantity(common.name) + unit), x=across, marks=below),
        ],
        _INCHES,
    )


def caption(diagnosis: BridgeDiagnosis) -> str:
    assert diagnosis.leading is not None
    leading = diagnosis.leading
    return (
        f"{effect_label(leading.effect, leading.at)[:1].upper()}"
        f"{effect_label(leading.effect, leading.at)[1:]}: above, the probability that a hanger has "
        "it; blue ones likelier have it than not. Below, its size in those, with 90 % intervals, "
        f"and the size common to the family, {size(leading.size)}."
    )


def _alt(diagnosis: BridgeDiagnosis) -> str:
    assert diagnosis.leading is not None
    told = [
        f"hanger {each.hanger} {formatting.probability(each.probability)}"
        for each in diagnosis.leading.members
    ]
    what = effect_label(diagnosis.leading.effect, diagnosis.leading.at)
    return f"Probability of {what}: {', '.join(told)}."


FIGURE = Member("shared", "Who has it, and of which size", specify, caption, _alt)
