"""Posterior of all parameters, each alone and each against each other."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from shm.report.content import HangerReport
from shm.report.figures import style
from shm.report.figures.member import Member
from shm.report.words import meaning
from shm.values import FloatArray, Posterior

_PANEL_INCHES = 1.6
_MOST_POINTS = 1000
_STRONG = 0.5


def draw(posterior: Posterior) -> Figure:
    """A histogram of each parameter on the diagonal, draws of each two below it.

    Their correlation stands above the diagonal. A cross is the most probable value.
    """
    names, samples = posterior.names, posterior.samples
    count, correlation = len(names), _correlation(samples)
    figure = style.new_figure(min(style.WIDTH_INCHES, _PANEL_INCHES * count))
    panels: Any = figure.subplots(count, count, squeeze=False, sharex="col")
    for row, column in np.ndindex(count, count):
        axes = panels[row, column]
        style.dress(axes, "", "")
        if row == column:
            _histogram(axes, samples[:, row])
        elif row > column:
            _draws(axes, posterior, column, row)
        else:
            _in_words(axes, float(correlation[row, column]))
        _quiet(axes, is_left=column == 0 < row, is_lowest=row == count - 1)
    for place, name in enumerate(names):
        panels[place, 0].set_ylabel(_label(name), fontsize=style.TINY, color=style.INK)
        panels[-1, place].set_xlabel(_label(name), fontsize=style.TINY, color=style.INK)
    return figure


def _label(name: str) -> str:
    return textwrap.fill(name.replace(".", " "), 12)


def _histogram(axes: Axes, values: FloatArray) -> None:
    axes.hist(values, bins=min(30, 10 + len(values) // 60), color=style.BLUE, alpha=0.8)
    axes.grid(False)


def _draws(axes: Axes, posterior: Posterior, column: int, row: int) -> None:
    x, y = posterior.samples[:_MOST_POINTS, [column, row]].T
    axes.plot(x, y, ".", color=style.BLUE, markersize=2, alpha=0.35, rasterized=True)
    best = posterior.most_probable[[column, row]]
    axes.plot(*best, "X", color=style.ORANGE, markersize=7, markeredgecolor="white")
    axes.yaxis.set_major_locator(MaxNLocator(3))


def _in_words(axes: Axes, correlation: float) -> None:
    axes.grid(False)
    for spine in axes.spines.values():
        spine.set_visible(False)
    axes.text(
        0.5, 0.5, f"{correlation:+z.2f}" if np.isfinite(correlation) else "constant",
        transform=axes.transAxes, ha="center", va="center", color=style.INK,
        fontsize=11 if abs(correlation) >= _STRONG else 9,
    )  # fmt: skip


def _quiet(axes: Axes, is_left: bool, is_lowest: bool) -> None:
    axes.xaxis.set_major_locator(MaxNLocator(3))
    axes.tick_params(
        labelsize=style.TINY - 1, left=is_left, labelleft=is_left, bottom=is_lowest,
        labelbottom=is_lowest,
    )  # fmt: skip


def _correlation(samples: FloatArray) -> FloatArray:
    """Of each two parameters (parameters, parameters); NaN where one does not vary."""
    spread = samples.std(axis=0)
    scaled = (samples - samples.mean(axis=0)) / np.where(spread > 0, spread, np.nan)
    return np.asarray(scaled.T @ scaled / len(samples))


def strongest(posterior: Posterior) -> tuple[str, str, float]:
    """The two parameters that go together most, and their correlation."""
    correlation = np.nan_to_num(np.triu(_correlation(posterior.samples), 1))
    row, column = np.unravel_index(np.abs(correlation).argmax(), correlation.shape)
    return posterior.names[row], posterior.names[column], float(correlation[row, column])


def _caption(data: HangerReport) -> str:
    first, second, correlation = strongest(data.posterior)
    named = "; ".join(f"{n}: {meaning(n, data.posterior.model)}" for n in data.posterior.names)
    return (
        "Posterior of all parameters: each alone on the diagonal, draws of each two below, their "
        "correlation above; cross: most probable value. Most alike go "
        f"{first} and {second} ({correlation:+z.2f}): what one may be depends on the other. "
        f"{named}."
    )


def _alt(data: HangerReport) -> str:
    first, second, correlation = strongest(data.posterior)
    return (
        f"Pair plot of {len(data.posterior.names)} parameters; the strongest correlation is "
        f"{correlation:+z.2f}, of {first} and {second}."
    )


FIGURE = Member(
    "pairs", "Parameters against each other", lambda data: draw(data.posterior), _caption, _alt
)
