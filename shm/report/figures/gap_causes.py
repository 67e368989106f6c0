"""Probabilities of the causes of a gap, of no gap and of something that is not in the catalogue.

Which hangers have a shared cause, and how large it is in each.
"""

from __future__ import annotations

import textwrap
from dataclasses import dataclass

from shm.report import formatting
from shm.report.contents import DiagnosisSheet
from shm.report.diagnosis_summary import write_lead
from shm.report.diagnosis_wording import label
from shm.report.figures import specification as spec
from shm.report.sizes import quantity, size
from shm.values import BridgeDiagnosis, Cause, Diagnosis, effect_label, group_causes
from shm.values.parameter_names import is_logarithm

_MOST = 8
"""Causes that are drawn, at most."""
_LEAST_SHOWN = 0.0005
_LEAST = 3
"""Causes that are drawn at least, however improbable."""
# Layout: inches of a row, and the longest line of a label in letters, which a phone shows, too.
_ROW_INCHES, _TALL_ROW_INCHES = 0.3, 0.4
_LABEL = 30
_LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"


@dataclass(frozen=True)
class Bar:
    """One row of the figure."""

    label: str
    probability: float
    colour: str


def specify(sheet: DiagnosisSheet) -> spec.Specification | None:
    """Return bars; causes that cannot be told apart have the same letter."""
    bars = _bars(sheet.diagnosis)
    if not any(bar.probability > 0 for bar in bars):
        return None
    labels = [textwrap.fill(bar.label, _LABEL) for bar in bars]
    is_tall = any(label.count("\n") > 1 for label in labels)
    drawn = [
        spec.Bars(
            x=[row], y=[bar.probability], lying=True, width=0.62, colour=bar.colour,
            labels=[formatting.probability(bar.probability)],
            texts=[f"{bar.label}: {formatting.probability(bar.probability)}"],
        )
        for row, bar in enumerate(bars)
    ]  # fmt: skip
    panel = spec.Panel(
        y=spec.Axis(
            range=(len(bars) - 0.45, -0.6), ticks=range(len(bars)), tick_labels=labels, grid=False
        ),
        x=spec.Axis(label="probability", range=(0, 1.15), ticks=(0, 0.2, 0.4, 0.6, 0.8, 1)),
        marks=drawn,
    )
    return spec.stacked([panel], (_TALL_ROW_INCHES if is_tall else _ROW_INCHES) * len(bars) + 1.0)


def _bars(diagnosis: Diagnosis) -> list[Bar]:
    return [
        *(
            Bar(label(cause) + _letter(cause.group), cause.probability, "blue")
            for cause in _shown(diagnosis)
        ),
        Bar("something not in the catalogue", diagnosis.unexplained_probability, "orange"),
        Bar("no gap", diagnosis.no_gap_probability, "green"),
    ]


def _letter(group: int | None) -> str:
    return "" if group is None else f" [{_LETTERS[group % len(_LETTERS)]}]"


def _shown(diagnosis: Diagnosis) -> list[Cause]:
    """Return causes of relevant probability, at least three where there are so many."""
    causes = [cause for claim in group_causes(diagnosis.causes) for cause in claim.causes]
    probable = [cause for cause in causes if cause.probability >= _LEAST_SHOWN]
    return probable[:_MOST] if len(probable) >= _LEAST else causes[:_LEAST]


def _caption(sheet: DiagnosisSheet) -> str:
    diagnosis = sheet.diagnosis
    left = len(diagnosis.causes) - len(_shown(diagnosis))
    verb = "is" if left == 1 else "are"
    more = f" {formatting.counted(left, 'less probable cause')} {verb} not drawn."
    groups = (
        " Causes with the same letter cannot be told apart with these data; what counts is their "
        "sum."
        if diagnosis.groups
        else ""
    )
    return (
        "Probability of each cause, of something that the catalogue does not hold, and of no gap; "
        f"all add to 1.{groups}{more if left > 0 else ''}"
    )


def _alt(sheet: DiagnosisSheet) -> str:
    bars = [
        f"{bar.label} {formatting.probability(bar.probability)}" for bar in _bars(sheet.diagnosis)
    ]
    return f"{write_lead(sheet.diagnosis)} Probabilities: {'; '.join(bars)}."


FIGURE = spec.FigureSpec("causes", "What causes the gap", specify, _caption, _alt)


_INCHES = 4.2  # technical: two panels of the height that others have
_LIKELIER_THAN_NOT = 0.5  # even odds
_MOST_TICKS = 24  # numbers of hangers that a page has room for


def specify_shared(diagnosis: BridgeDiagnosis) -> spec.Specification | None:
    """Return the probability of each hanger to have it above its size with the family's."""
    if (leading := diagnosis.leading) is None:
        return None
    at = range(len(leading.members))
    step = 1 + (len(leading.members) - 1) // _MOST_TICKS
    ticks = list(at)[::step]
    labels = [str(leading.members[tick].hanger) for tick in ticks]
    across = spec.Axis(
        label="hanger", range=(-0.7, len(leading.members) - 0.3), ticks=ticks,
        tick_labels=labels, grid=False,
    )  # fmt: skip
    named = [i for i in at if leading.members[i].probability > _LIKELIER_THAN_NOT]
    marks: list[spec.Mark] = []
    for colour, rows in (("blue", named), ("quiet", [i for i in at if i not in named])):
        shares = [leading.members[i].probability for i in rows]
        texts = [
            f"hanger {leading.members[i].hanger}: {leading.members[i].probability:.2f}"
            for i in rows
        ]
        if rows:
            marks.append(spec.Bars(x=rows, y=shares, width=0.62, colour=colour, texts=texts))
    sizes = [leading.members[i].size for i in named]
    common = leading.size
    unit = f" (log10, {common.unit})" if is_logarithm(common.name) else f" ({common.unit})"
    ends = [-0.7, len(leading.members) - 0.3]
    below = [
        spec.Band(
            x=ends, low=[common.q05] * 2, high=[common.q95] * 2, colour="orange", opacity=0.25,
            name="the family's own, 90 %",
        ),
        spec.Points(
            x=named, y=[each.mean for each in sizes], low=[each.q05 for each in sizes],
            high=[each.q95 for each in sizes], colour="blue", name="hanger, 90 %",
        ),
    ]  # fmt: skip
    return spec.stacked(
        [
            spec.Panel(
                y=spec.Axis(label="probability", range=(0, 1.05)),
                marks=[*marks, spec.Rule(at=_LIKELIER_THAN_NOT, dash="dot", colour="ink")],
            ),
            spec.Panel(y=spec.Axis(label=quantity(common) + unit), x=across, marks=below),
        ],
        _INCHES,
    )


def shared_caption(diagnosis: BridgeDiagnosis) -> str:
    assert diagnosis.leading is not None
    leading = diagnosis.leading
    return (
        f"{effect_label(leading.effect, leading.at)[:1].upper()}"
        f"{effect_label(leading.effect, leading.at)[1:]}: above, the probability that a hanger has "
        "it; blue ones likelier have it than not. Below, its size in those, with 90 % intervals, "
        f"and the size common to the family, {size(leading.size)}."
    )


def _shared_alt(diagnosis: BridgeDiagnosis) -> str:
    assert diagnosis.leading is not None
    wording = [
        f"hanger {each.hanger} {formatting.probability(each.probability)}"
        for each in diagnosis.leading.members
    ]
    what = effect_label(diagnosis.leading.effect, diagnosis.leading.at)
    return f"Probability of {what}: {', '.join(wording)}."


SHARED = spec.FigureSpec(
    "shared", "Who has it, and of which size", specify_shared, shared_caption, _shared_alt
)
