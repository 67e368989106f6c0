"""Draw the gap of every mode by plane and order, and what the leading cause leaves of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shm.report import formatting
from shm.report.contents import DiagnosisSheet
from shm.report.diagnosis_wording import label
from shm.report.figures import specification as spec
from shm.report.formatting import NORMAL_90
from shm.values import PLANES, Plane, Residual, is_excluded

_SPREAD = 0.4
"""Width over which the tests of one mode stand side by side, in orders."""
_CLEAR_SD = 2.0
"""Standard deviations beyond which a gap is drawn as clear."""
# Layout: room for what lies beyond the axis, height of a panel, where the cause's marks stand.
_EDGE = 0.16
_PANEL_INCHES = 2.0
_AFTER = (
    ("after_percent", "with the cause", True, 0.28),
    ("held_out_after_percent", "with the cause, held out", False, 0.4),
)


def measured(sheet: DiagnosisSheet) -> list[Residual]:
    """Return the residuals that are known."""
    return [r for r in sheet.diagnosis.where if math.isfinite(r.residual_percent)]


def retained(sheet: DiagnosisSheet) -> list[Residual]:
    """Return those that were not excluded as gross errors."""
    return [r for r in measured(sheet) if not is_excluded(sheet.diagnosis, r)]


def excluded(sheet: DiagnosisSheet) -> list[Residual]:
    """Return those that were excluded as gross errors."""
    return [r for r in measured(sheet) if is_excluded(sheet.diagnosis, r)]


def has_cause(sheet: DiagnosisSheet) -> bool:
    """Return True if a cause is claimed, and what it leaves of the gap is known."""
    known = any(math.isfinite(r.after_percent) for r in retained(sheet))
    return known and sheet.diagnosis.verdict.claim is not None


def specify(sheet: DiagnosisSheet) -> spec.Specification | None:
    """Return a panel for each plane over the orders, with one vertical axis."""
    residuals = measured(sheet)
    if not residuals:
        return None
    ordinary = retained(sheet)
    halves = np.nan_to_num([NORMAL_90 * _sd_percent(r) for r in ordinary])
    inside = np.array([r.residual_percent for r in ordinary or residuals])
    ends = (inside - halves, inside + halves, [0.0]) if ordinary else (inside,)
    low, high = spec.limits(*ends)
    margin = (_EDGE if excluded(sheet) else 0.0) * (high - low)
    orders = sorted({r.order for r in residuals})
    across = spec.Axis(
        label="order of the mode", range=(orders[0] - 0.6, orders[-1] + 0.6), grid=False,
        ticks=orders[:: math.ceil(len(orders) / 12)],
    )  # fmt: skip
    planes = [plane for plane in PLANES if any(r.plane == plane for r in residuals)]
    panels = [
        spec.Panel(
            y=spec.Axis(label="gap (%)", range=(low - margin, high + margin)),
            marks=[
                spec.Rule(at=0, width=0.8),
                *_baseline([r for r in ordinary if r.plane == plane], plane, sheet.diagnosis.tests),
                *_excluded([r for r in excluded(sheet) if r.plane == plane], sheet, low, high),
                *_with_cause([r for r in ordinary if r.plane == plane], plane, sheet),
            ],
            title=f"{plane} plane", title_colour=spec.PLANE_HUES[plane], title_side="left",
        )
        for plane in planes
    ]  # fmt: skip
    panels[-1] = replace(panels[-1], x=across)
    return spec.stacked(panels, _PANEL_INCHES * len(panels) + 0.7, legend_columns=3)


def _baseline(residuals: Sequence[Residual], plane: Plane, tests: Sequence[str]) -> list[spec.Mark]:
    """Return a mark for each test beside the others of its mode, filled where the gap is clear."""
    this = spec.PLANE_SYMBOLS[plane]
    kinds: tuple[tuple[list[Residual], spec.Symbol, bool, str], ...] = (
        ([r for r in residuals if abs(r.z) >= _CLEAR_SD], this, True, "beyond 2 sd"),
        ([r for r in residuals if abs(r.z) < _CLEAR_SD], this, False, "within 2 sd"),
        ([r for r in residuals if math.isnan(r.z)], "thin cross", True, "sd not known"),
    )
    found: list[spec.Mark] = []
    for chosen, symbol, filled, name in kinds:
        if chosen:
            y = np.array([r.residual_percent for r in chosen])
            half = np.array([NORMAL_90 * _sd_percent(r) for r in chosen])
            found.append(
                spec.Points(
                    x=[r.order + _offset(r.test, tests) for r in chosen], y=y, low=y - half,
                    high=y + half, caps=False, symbol=symbol, filled=filled, name=name,
                    size=4.6 if len(tests) <= 6 else 3.2, colour=spec.PLANE_HUES[plane],
                    texts=_wording(chosen),
                )
            )  # fmt: skip
    return found


def _excluded(
    residuals: Sequence[Residual], sheet: DiagnosisSheet, low: float, high: float
) -> list[spec.Mark]:
    """Return gross errors as crosses with their size, at the edge if they exceed the others."""
    last = max(r.order for r in measured(sheet))
    return [
        spec.Points(
            x=[r.order + _offset(r.test, sheet.diagnosis.tests)],
            y=[min(max(r.residual_percent, low), high)], symbol="cross", size=7, colour="red",
            name="excluded", labels=[f"{r.residual_percent:+z.2f} %"],
            label_side="left" if r.order > (1 + last) / 2 else "right", texts=_wording([r]),
        )
        for r in residuals
    ]  # fmt: skip


def _with_cause(
    residuals: Sequence[Residual], plane: Plane, sheet: DiagnosisSheet
) -> list[spec.Mark]:
    """Return what the cause leaves: means over the tests, from the least to the largest."""
    found: list[spec.Mark] = []
    for field, name, filled, offset in _AFTER if has_cause(sheet) else ():
        values = {
            order: known
            for order in sorted({r.order for r in residuals})
            if (known := _known([r for r in residuals if r.order == order], field))
        }
        if values:
            found.append(
                spec.Points(
                    x=[order + offset for order in values],
                    y=[float(np.mean(known)) for known in values.values()],
                    low=[min(known) for known in values.values()],
                    high=[max(known) for known in values.values()], caps=False, symbol="diamond",
                    filled=filled, name=name, colour="green",
                    hover=f"{plane}, {name}: %{{y:.2f}} %",
                )
            )  # fmt: skip
    return found


def _known(residuals: Sequence[Residual], field: str) -> list[float]:
    values = [getattr(r, field) for r in residuals]
    return [value for value in values if math.isfinite(value)]


def _wording(residuals: Sequence[Residual]) -> list[str]:
    return [
        f"{r.plane} {r.order}, {r.test}: {r.residual_percent:+.2f} %, measured "
        f"{formatting.number(r.measured_hz, '.3f')} Hz"
        for r in residuals
    ]


def _offset(test: str, tests: Sequence[str]) -> float:
    if test not in tests or len(tests) < 2:
        return 0.0
    return _SPREAD * (tests.index(test) / (len(tests) - 1) - 0.5)


def _sd_percent(residual: Residual) -> float:
    """Return the standard deviation that the z-score was counted in."""
    return abs(residual.residual_percent / residual.z) if residual.z else math.nan


def _caption(sheet: DiagnosisSheet) -> str:
    order = (
        " The tests of one mode stand side by side in their order."
        if len(sheet.diagnosis.tests) > 1
        else ""
    )
    crosses = " Crosses: gross errors, excluded." if excluded(sheet) else ""
    return (
        f"Measured frequency over what the baseline {sheet.diagnosis.baseline} predicts at its "
        "best, less 1. Bars: 90 % interval of the measurement and of what the baseline leaves "
        f"open; filled: beyond 2 standard deviations.{crosses}{order}{_caption_of_cause(sheet)}"
    )


def _caption_of_cause(sheet: DiagnosisSheet) -> str:
    claim = sheet.diagnosis.verdict.claim
    if claim is None or not has_cause(sheet):
        return ""
    held_out = (
        "open: the same where the mode or its test was held out of the fit"
        if _known(retained(sheet), "held_out_after_percent")
        else "nothing that it moves was held out of the fit"
    )
    return f" Green diamonds: what {label(claim.leading)} leaves, means over the tests; {held_out}."


def _alt(sheet: DiagnosisSheet) -> str:
    residuals = measured(sheet)
    worst = sorted(residuals, key=lambda r: -abs(r.residual_percent))[:3]
    wording = ", ".join(
        f"{r.plane} {r.order} in {r.test} {r.residual_percent:+z.2f} %" for r in worst
    )
    count = formatting.counted(len(residuals), "residual")
    gross = ", ".join(f"{r.plane} {r.order} in {r.test}" for r in excluded(sheet))
    gross_words = f" Excluded as a gross error: {gross}." if gross else ""
    after = ""
    if has_cause(sheet):
        before, left = (
            _rms(retained(sheet), field) for field in ("residual_percent", "after_percent")
        )
        after = f" With the cause their root mean square goes from {before} to {left}."
    return f"{count} of frequencies; the largest: {wording}.{gross_words}{after}"


def _rms(residuals: Sequence[Residual], field: str) -> str:
    size = float(np.sqrt(np.mean(np.square(_known(residuals, field)))))
    return f"{formatting.plain(size, 2)} %"


FIGURE = spec.FigureSpec("gap_map", "Where the gap lies", specify, _caption, _alt)
