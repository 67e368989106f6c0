"""Figures of the report, for a notebook: each function returns a `matplotlib.figure.Figure`.

The figures are those of `shm report`, `shm identify --html` and `shm gap diagnose --html`: labels
and units on every axis, colours that the colour-blind tell apart, on white. A notebook shows what a
cell returns; elsewhere `figure.savefig("tension.png", dpi=150)`. Axes may be changed as any of
matplotlib's: `figure.axes[0].set_title("Hanger 3")`. With `ax` a figure is drawn on axes of yours,
as many as it has panels. Where the data lack what a figure shows,
NothingThere says so.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, TypeAlias, TypeVar

from shm import __version__
from shm.errors import NothingThere, UsageError
from shm.identify import Identification
from shm.report.contents import (
    DiagnosisSheet,
    HangerReport,
    ModalTestReport,
    TrendRow,
    summary_of,
    trend_row,
)
from shm.report.figures.gap_causes import FIGURE as CAUSES
from shm.report.figures.gap_check import FIGURE as CHECK
from shm.report.figures.gap_map import FIGURE as GAP_MAP
from shm.report.figures.hanger_frequencies import FIGURE as FREQUENCIES
from shm.report.figures.hanger_stiffness import FIGURE as STIFFNESS
from shm.report.figures.hanger_tension import FIGURE as TENSION
from shm.report.figures.hanger_trend import FIGURE as TREND
from shm.report.figures.modal_test_axes import ResponseCurves
from shm.report.figures.modal_test_modes import SHAPES, STABILISATION
from shm.report.figures.modal_test_response import FIGURE as RESPONSE
from shm.report.figures.recording_channels import FIGURE as CHANNELS
from shm.report.figures.recording_channels import TOGETHER
from shm.report.figures.specification import FigureSpec, Specification
from shm.values import NAN, Diagnosis, GapCheck, Hanger, ModalTest, Posterior, Recording

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "causes",
    "frequencies",
    "frequency_response",
    "gap",
    "gap_check",
    "recording",
    "shapes",
    "stabilisation",
    "stiffness",
    "tension",
    "trend",
]

Data = TypeVar("Data")
Ax: TypeAlias = "Axes | Iterable[Axes] | None"
"""Where to draw: axes for each panel in reading order; None makes a figure."""


def tension(
    posterior: Posterior, hanger: Hanger, baseline: Posterior | None = None, *, ax: Ax = None
) -> Figure:
    """Draw the posterior of the tension: histogram, 90 % interval, nominal and baseline tension.

    Example:
        >>> figure = shm.plot.tension(posterior, hanger)
        >>> figure.axes[0].get_xlabel()
        'tension (kN)'
    """
    return _drawn(TENSION, _report(posterior, hanger, baseline=baseline), ax)


def trend(
    posteriors: Sequence[Posterior],
    tests: Sequence[ModalTest],
    hanger: Hanger,
    baseline: Posterior | None = None,
    *,
    ax: Ax = None,
) -> Figure:
    """Draw the tension over time: mean and 90 % band by test, nominal, baseline, thresholds.

    `posteriors` and `tests` go together, one posterior a test; tests without a time are left out.
    Where temperatures are known a strip below has them, but not on one `ax`.

    Example:
        >>> with shm.Store("arch") as store:
        ...     posteriors = store.posteriors(3)
        ...     figure = shm.plot.trend(posteriors, store.tests(3), store.hanger(3))
    """
    if ax is not None and not isinstance(ax, Iterable):
        tests = [replace(test, temperature_c=NAN) for test in tests]
    return _drawn(TREND, _history(posteriors, tests, hanger, baseline), ax)


def stiffness(
    posteriors: Sequence[Posterior],
    tests: Sequence[ModalTest],
    hanger: Hanger,
    baseline: Posterior | None = None,
    *,
    ax: Ax = None,
) -> Figure:
    """Draw the end stiffness in MN m/rad over time, a panel for each plane, with its 90 % band.

    `posteriors` and `tests` go together, one posterior a test. The model class must have springs
    at the ends (`beam2`, `solid1`, `solid2`).

    Example:
        >>> figure = shm.plot.stiffness(posteriors, tests, hanger)
    """
    return _drawn(STIFFNESS, _history(posteriors, tests, hanger, baseline), ax)


def frequencies(
    posterior: Posterior, test: ModalTest | Identification, hanger: Hanger, *, ax: Ax = None
) -> Figure:
    """Draw predicted over measured frequency of every mode of `test`, with uncertainties.

    The light band is the model error sigma: a mode outside is one that the model does not
    explain.

    Example:
        >>> figure = shm.plot.frequencies(posterior, test, hanger)
    """
    modal = test.test if isinstance(test, Identification) else test
    return _drawn(FREQUENCIES, _report(posterior, hanger, tests=(modal,)), ax)


def frequency_response(
    test: Identification, hanger: Hanger | None = None, *, ax: Ax = None
) -> Figure:
    """Draw a test's frequency response in m/s^2/N over Hz, with fitted modes and coherence.

    Example:
        >>> test = shm.identify(shm.read("hanger3.csv"), hanger=hanger)
        >>> figure = shm.plot.frequency_response(test)
    """
    return _drawn(RESPONSE, ResponseCurves.of(ModalTestReport(test, hanger=hanger)), ax)


def stabilisation(test: Identification, hanger: Hanger | None = None, *, ax: Ax = None) -> Figure:
    """Draw the poles of all model orders over Hz, and which of them became modes.

    Example:
        >>> figure = shm.plot.stabilisation(test)
    """
    return _drawn(STABILISATION, ResponseCurves.of(ModalTestReport(test, hanger=hanger)), ax)


def shapes(test: Identification, hanger: Hanger, *, ax: Ax = None) -> Figure:
    """Draw the identified mode shapes along the hanger in m from the deck end, by plane and order.

    Example:
        >>> figure = shm.plot.shapes(test, hanger)
    """
    return _drawn(SHAPES, ResponseCurves.of(ModalTestReport(test, hanger=hanger)), ax)


def gap(diagnosis: Diagnosis, hanger: Hanger, *, ax: Ax = None) -> Figure:
    """Draw the gap between model and measurement by mode, condition and place.

    Example:
        >>> figure = shm.plot.gap(shm.diagnose(tests, hanger), hanger)
    """
    return _drawn(GAP_MAP, DiagnosisSheet(diagnosis, hanger), ax)


def causes(diagnosis: Diagnosis, hanger: Hanger, *, ax: Ax = None) -> Figure:
    """Draw the probability of each cause of a gap, of no gap, of something unknown.

    Example:
        >>> figure = shm.plot.causes(shm.diagnose(tests, hanger), hanger)
    """
    return _drawn(CAUSES, DiagnosisSheet(diagnosis, hanger), ax)


def gap_check(check: GapCheck, *, ax: Ax = None) -> Figure:
    """Draw from which size on a diagnosis would find each effect.

    Example:
        >>> figure = shm.plot.gap_check(shm.check_gap(tests, hanger, effects=["point_mass"]))
    """
    return _drawn(CHECK, check, ax)


def recording(recording: Recording, *, ax: Ax = None) -> Figure:
    """Draw every channel of a recording over time, in N and m/s^2.

    On one `ax` all channels are drawn, each as a fraction of its largest value; on as many as the
    recording has channels, each on its own.

    Example:
        >>> figure = shm.plot.recording(shm.read("hanger3.csv"))
    """
    is_one = ax is not None and not isinstance(ax, Iterable)
    return _drawn(TOGETHER if is_one else CHANNELS, recording, ax)


def _drawn(member: FigureSpec[Data], data: Data, ax: Ax) -> Figure:
    """Draw a figure, on `ax` where that is given; raises NothingThere, UsageError."""
    specification = member.draw(data)
    if not isinstance(specification, Specification):
        raise NothingThere(
            f"these data do not hold what the figure {member.title!r} shows.",
            remedy="See the docstring for what it needs.",
        )
    from shm.report.figures.with_matplotlib import draw, draw_on

    if ax is None:
        figure = draw(specification)
        figure.set_facecolor("white")
        return figure
    axes = list(ax) if isinstance(ax, Iterable) else [ax]
    count = len(specification.panels)
    if len(axes) != count:
        raise UsageError(
            f"the figure {member.title!r} has {count} panels, and ax has {len(axes)}.",
            remedy=f"Give as many: figure, ax = plt.subplots({count}); "
            f"shm.plot.{member.name}(..., ax=ax).",
        )
    draw_on(specification, axes)
    return axes[0].get_figure(root=True)  # type: ignore[return-value]


def _history(
    posteriors: Sequence[Posterior],
    tests: Sequence[ModalTest],
    hanger: Hanger,
    baseline: Posterior | None,
) -> HangerReport:
    _refuse_unless_matched(posteriors, tests)
    rows = zip(posteriors, tests, strict=True)
    trend = tuple(trend_row(posterior, test, hanger) for posterior, test in rows)
    return _report(posteriors[-1], hanger, tuple(tests), trend=trend, baseline=baseline)


def _refuse_unless_matched(posteriors: Sequence[Posterior], tests: Sequence[ModalTest]) -> None:
    named = [test.id for test in tests]
    used = [posterior.tests[-1] for posterior in posteriors]
    if not posteriors or named != used:
        raise UsageError(
            f"{len(posteriors)} posteriors and {len(tests)} tests are not one posterior a test.",
            remedy="Give the posterior of each test in the order of the tests.",
        )


def _report(
    posterior: Posterior,
    hanger: Hanger,
    tests: tuple[ModalTest, ...] = (),
    trend: tuple[TrendRow, ...] = (),
    baseline: Posterior | None = None,
) -> HangerReport:
    """Return the data that the figures of a hanger are drawn from."""
    return HangerReport(
        bridge="",
        now=summary_of(
            hanger, tests[-1] if tests else ModalTest("latest", ()), posterior, baseline
        ),
        tests=tests,
        posterior=posterior,
        generated_at=datetime.now(UTC),
        version=__version__,
        trend=trend,
        baseline=baseline,
    )
