"""The figures of the model: how its frequencies fit, what is open, which class it is."""

from __future__ import annotations

from shm.report import formatting
from shm.report.contents import HangerReport
from shm.report.figures.gap_causes import Bar, probability_bars
from shm.report.figures.hanger_frequencies import FIGURE as OF_REPORT
from shm.report.figures.hanger_frequencies import compared_modes
from shm.report.figures.parameter_pairs import FIGURE as OF_PAIRS
from shm_daemon.web.hanger_figures.member import HangerFigure
from shm_daemon.web.hanger_view import HangerView


def report_of(view: HangerView) -> HangerReport:
    """The report of a view that has one."""
    assert view.report is not None
    return view.report


FREQUENCIES = HangerFigure(
    "frequencies",
    OF_REPORT.title,
    "model",
    lambda view: view.report is not None and bool(compared_modes(view.report)),
    lambda view: OF_REPORT.draw(report_of(view)),
    lambda view: OF_REPORT.caption(report_of(view)),
    lambda view: OF_REPORT.alt(report_of(view)),
    height_px=380,  # judgement: the usual, with words below the axis
)


PAIRS = HangerFigure(
    "pairs",
    OF_PAIRS.title,
    "model",
    lambda view: view.report is not None and len(view.report.posterior.names) > 1,
    lambda view: OF_PAIRS.draw(report_of(view)),
    lambda view: OF_PAIRS.caption(report_of(view)),
    lambda view: OF_PAIRS.alt(report_of(view)),
    height_px=760,  # judgement: a grid of a panel for each pair, nearly square
    is_wide=True,
)


def _rows(view: HangerView) -> list[tuple[str, float]]:
    """Names and probabilities of the model classes, the most probable first."""
    found = view.report.selection if view.report else None
    if found is None:
        return []
    return [
        (formatting.model_class(posterior.model), share)
        for posterior, share in zip(found.posteriors, found.probabilities, strict=True)
    ]


def _chosen(view: HangerView) -> str:
    return formatting.model_class(report_of(view).posterior.model)


def _alt_of_models(view: HangerView) -> str:
    told = [f"{name} {formatting.probability(share)}" for name, share in _rows(view)]
    return f"Probabilities of the model classes: {'; '.join(told)}."


MODELS = HangerFigure(
    "models",
    "Model classes",
    "model",
    lambda view: len(_rows(view)) > 1,
    lambda view: probability_bars(
        [Bar(name, p, "blue" if name == _chosen(view) else "quiet") for name, p in _rows(view)]
    ),
    lambda view: (
        "Probability of each model class given the tests on which they were compared, all equally "
        f"probable before. Blue: the class in force, {_chosen(view)}."
    ),
    _alt_of_models,
    height_px=240,  # judgement: a bar for each of a few classes
)
