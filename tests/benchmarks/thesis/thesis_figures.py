"""What `validate.py --figure` gives of the figures of the thesis that are no solid's frequencies.

Figures B.1 to B.14 of the thesis: modes 1 to 7 of "Model 4", the solid on springs, x and y.

Figures 5.1 to 5.37 of the thesis: ours of the same class, data and parameters.

The data are table 1.1, counted ten times (docs/trials/validation.md).

Figures 2.3 to 2.7 of the thesis: a beam's dimensionless frequencies against xi = L sqrt(T/EI).

Problem A is clamped, problem B on rotational springs. eta_n is a frequency over that of a string
(2.26), phi_n over that of a clamped beam without tension (2.31). The thesis prints no values beside
its curves; so each point is held against the thesis's own equation, the determinant (2.45).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

import numpy as np

from shm import __version__
from shm.inference import UpdateOptions, update
from shm.models import THESIS, build
from shm.models.solid.classes import SolidModel
from shm.models.tensioned_beam import wave_numbers
from shm.report.contents import HangerReport, summary_of
from shm.report.figures import hanger_frequencies
from shm.report.figures.prediction_figures import (
    Curves,
    specify,
    write_curves_png,
    write_deformed_png,
)
from shm.report.figures.specification import Specification
from shm.values import PLANES, FloatArray, Hanger, Plane, Posterior, Summary
from tests.benchmarks.thesis import frequencies, parameter_pairs, thesis_data


@dataclass(frozen=True, eq=False)
class Figure:
    """A table and a picture of ours: `cells` stand under `heads`, `statement` below them.

    `missed` says what is beyond its mark; empty where nothing is. A picture that no specification
    tells, of a body in space, is written by `draw`.
    """

    title: str
    heads: Sequence[str]
    cells: Sequence[Sequence[str]]
    statement: str
    document: Any
    specification: Specification | None = None
    missed: str = ""
    draw: Callable[[Path, str], None] | None = None

    def write(self, path: Path) -> None:
        """The picture, as PNG, with what it says below."""
        words = f"{self.title}. {self.statement}"
        if self.specification is not None:
            write_curves_png(self.specification, path, words)
        elif self.draw is not None:
            self.draw(path, words)


# Thesis, appendix B: seven orders, x before y.
MODE_SHAPES: dict[str, tuple[int, Plane]] = {
    f"B.{2 * order - 1 + place}": (order, plane)
    for order in range(1, 8)
    for place, plane in enumerate(PLANES)
}
_TOLD = 13  # places along the hanger in the table: each metre of hanger 3


def mode_shape(hanger: Hanger, tell: Callable[[str, float], None], number: str) -> Figure:
    """Class 1 at nominal tension, its springs as stiff as a clamp: they are not stated."""
    order, plane = MODE_SHAPES[number]
    model = build("solid1", hanger, THESIS)
    assert isinstance(model, SolidModel)
    stiff = np.log10(frequencies.STIFFEST_SOLVED)
    theta = np.array([1.0, *[stiff] * (len(model.parameter_names) - 1)])
    corners, moved = model.surface(theta, plane, order)
    tell(f"figure {number}", 1.0)
    hz = float(model.reference_frequencies_hz(theta[None], order)[0, PLANES.index(plane), -1])
    axis = PLANES.index(plane)
    at_m, size = corners[..., 2].ravel(), moved[..., axis].ravel()
    places, along = np.linspace(at_m.min(), at_m.max(), _TOLD), np.argsort(at_m)
    told = np.interp(places, at_m[along], size[along])
    rows = [
        {"from_deck_m": place, "displacement": value}
        for place, value in zip(places.tolist(), told.tolist(), strict=True)
    ]
    return Figure(
        f"Figure {number}: mode {order} in {'xy'[axis]}, {hz:.2f} Hz",
        ("from the deck end (m)", "displacement"),
        [(f"{each['from_deck_m']:.1f}", f"{each['displacement']:+.3f}") for each in rows],
        "Class 1 at 711 kN, springs as stiff as a clamp. The largest displacement is 1.",
        {"figure": number, "order": order, "plane": plane, "frequency_hz": hz, "surface": rows},
        draw=lambda path, words: write_deformed_png(corners, moved, path, words),
    )


Tell = Callable[[str, float], None]
# As in the thesis, chapter 5: data and N_D; technical: draws enough for a marginal.
_PRINTING, _REPEAT, _SAMPLES = "table 1.1", 10, 2000

# Class and parameters by figure: one or more alone, "a/b" a against b, "" the frequencies.
_ALL = """
5.1 beam1 L F sigma | 5.2 beam1 L/F | 5.3 beam1
5.4 beam2 F L k1 k2 | 5.5 beam2 k3 k4 sigma | 5.6 beam2 L/F | 5.7 beam2 k1/F | 5.8 beam2 k1/L
5.9 beam2 k2/F | 5.10 beam2 k2/L | 5.11 beam2 k2/k1 | 5.12 beam2 k3/F | 5.13 beam2 k3/L
5.14 beam2 k3/k1 | 5.15 beam2 k4/F | 5.16 beam2 k4/L | 5.17 beam2 k4/k1 | 5.18 beam2
5.19 solid0 F sigma | 5.20 solid0 sigma/F | 5.21 solid0
5.22 solid1 F k1 k2 k3 | 5.23 solid1 k4 kly krx kry | 5.24 solid1 klx sigma | 5.25 solid1 k1/F
5.26 solid1 k3/k2 | 5.27 solid1 k4/k3 | 5.28 solid1 klx/F | 5.29 solid1
5.30 solid2 F k1 k2 k3 | 5.31 solid2 k4 sigma | 5.32 solid2 k4/k1 | 5.33 solid2 k1/F
5.34 solid2 k2/F | 5.35 solid2 k3/F | 5.36 solid2 k4/F | 5.37 solid2
"""
_MISPRINTED = {
    "5.24": "The caption names kly again; klx, which no other shows, stands for it.",
    "5.28": "The caption names kx, the list of figures krx and k3; klx stands for it.",
    "5.31": "The caption names k4 twice; sigma stands for one.",
    "5.32": "The caption names class 1, the text class 2.",
}
POSTERIORS = {
    number: (model, tuple(names))
    for each in _ALL.replace("\n", "|").split("|")
    if each.strip()
    for number, model, *names in [each.split()]
}


def posterior(hanger: Hanger, tell: Tell, number: str) -> Figure:
    """One of `FIGURES`: the class is updated, then drawn."""
    model, names = POSTERIORS[number]
    posterior = _posterior(hanger, model, tell)
    if not names:
        return _frequencies(hanger, posterior, number)
    alone = tuple(_name(part) for part in "/".join(names).split("/"))
    data = f"{_DATA} {_MISPRINTED.get(number, '')}".strip()
    heads = ("parameter", "most probable", "mean", "sd", "5 %", "median", "95 %")
    cells, document = [], {}
    for name in alone:
        told = Summary.of(posterior.parameter(name))
        best = float(posterior.most_probable[posterior.names.index(name)])
        values = (best, told.mean, told.sd, told.q05, told.q50, told.q95)
        cells.append((name, *(f"{value:.4g}" for value in values)))
        document[name] = dict(zip(heads[1:], values, strict=True))
    if "/" not in names[0]:
        drawn = parameter_pairs.marginals(posterior, alone)
        return Figure(_title(number, "alone"), heads, cells, data, document, drawn)
    pair = np.array([posterior.parameter(name) for name in alone])
    statement = f"{data} Correlation {np.corrcoef(pair)[0, 1]:+.2f}. Colours: posterior density."
    drawn = parameter_pairs.pair(posterior, *alone)
    return Figure(_title(number, "against each other"), heads, cells, statement, document, drawn)


_DATA = f"Data: {_PRINTING}, N_D = {_REPEAT}; priors of the thesis."


def _title(number: str, what: str) -> str:
    return f"Figure {number}: parameters of class {POSTERIORS[number][0]} {what}"


def _name(short: str) -> str:
    known = {"F": "theta_F", "L": "theta_L", "sigma": "sigma"}
    return known.get(short, f"log10_{short}")


def _posterior(hanger: Hanger, model: str, tell: Tell) -> Posterior:
    options = UpdateOptions(samples=_SAMPLES)
    tests = thesis_data.measured_tests(_PRINTING, _REPEAT)
    found = update(tests, build(model, hanger, THESIS), options, tell)
    # The copies of the data have equal predictions: those of the first stand for all.
    return replace(found, predicted=found.predicted[: len(found.predicted) // _REPEAT])


def _frequencies(hanger: Hanger, posterior: Posterior, number: str) -> Figure:
    tests = tuple(thesis_data.measured_tests(_PRINTING))
    now = summary_of(hanger, tests[-1], posterior)
    report = HangerReport("", now, tests, posterior, datetime.now(UTC), __version__)
    rows = posterior.predicted
    cells = [
        (
            each.plane, str(each.order), f"{each.measured_hz:.2f}",
            f"{each.mean_hz:.3f} ± {each.sd_hz:.3f}", f"{each.mean_hz / each.measured_hz:.4f}",
        )
        for each in rows
    ]  # fmt: skip
    heads = ("plane", "mode", "measured (Hz)", "predicted (Hz)", "over measured")
    drawn = hanger_frequencies.specify(report)
    title = f"Figure {number}: uncertainty propagated to the frequencies of {posterior.model}"
    return Figure(title, heads, cells, _DATA, [asdict(each) for each in rows], drawn)


MODES = 7  # as many as the thesis draws
_POINTS = 400  # technical: a smooth line
_ROWS = 10  # layout
_STIFF = 1e6  # "when the springs obtain large values": within 1e-6 of clamped
LIMIT = 1e-6
"""How far a root of ours may be from one of the thesis's equation, as a fraction: double precision
leaves 1e-9 of it where the terms cancel most, at the largest xi."""


@dataclass(frozen=True)
class Drawn:
    """One figure of the thesis: eta or phi from `low` to `high` in xi, springs k L/EI alike."""

    number: str
    quantity: Literal["eta", "phi"]
    low: float
    high: float
    spring: float
    remark: str = ""

    @property
    def title(self) -> str:
        ends = "clamped" if np.isinf(self.spring) else f"springs of k L/EI = {self.spring:g}"
        return f"Figure {self.number}: {self.quantity}_n against xi, ends {ends}"


_LARGE, _SMALL = (20.0, 200.0), (0.1, 20.0)  # xi above and below 20, as the thesis parts them
SOLUTIONS = {
    each.number: each
    for each in (
        Drawn("2.3", "eta", *_LARGE, np.inf),
        Drawn("2.4", "phi", *_SMALL, np.inf),
        Drawn("2.5", "phi", *_SMALL, _STIFF),
        Drawn(
            "2.6", "eta", *_LARGE, _STIFF,
            "The thesis's curves are noisy here: its root search starts from guesses. These come "
            "from an equation with one root a mode. Its caption says small xi, its text large.",
        ),
        Drawn(
            "2.7", "phi", *_SMALL, 10.0,
            "The thesis's caption says problem A, its text springs, not how stiff; 10 is half way "
            "between pinned and clamped.",
        ),
    )
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Solutions:
    """`values` (points, modes) of eta_n or phi_n at `xi` (points,), and how far the thesis's own
    equation has its roots from there, at most, as a fraction."""

    figure: Drawn
    xi: FloatArray
    values: FloatArray
    difference: float

    @property
    def statement(self) -> str:
        """How well the thesis's equation is solved, and what it leaves open."""
        told = (
            f"The thesis's equation (2.45) has its roots within {self.difference:.0e} of these "
            "frequencies, as a fraction."
        )
        return f"{told} {self.figure.remark}".strip()

    def rows(self, count: int = _ROWS) -> list[tuple[float, FloatArray]]:
        """Some points of the curves, evenly apart, each xi with the values of all modes."""
        chosen = np.linspace(0, len(self.xi) - 1, count).round().astype(int)
        return [(float(self.xi[n]), self.values[n]) for n in chosen]

    def document(self) -> dict[str, Any]:
        return {
            "figure": self.figure.number,
            "quantity": f"{self.figure.quantity}_n",
            "spring": None if np.isinf(self.figure.spring) else self.figure.spring,
            "difference": self.difference,
            "remark": self.figure.remark,
            "points": [
                {"xi": float(xi), "values": row.tolist()}
                for xi, row in zip(self.xi, self.values, strict=True)
            ],
        }

    def specification(self) -> Specification:
        name = {"eta": "η", "phi": "φ"}[self.figure.quantity]
        return specify(
            [Curves(self.figure.title, self.xi, self.values)], "ξ = L √(T/EI)", f"{name}ₙ"
        )


def solution(hanger: Hanger, tell: Callable[[str, float], None], number: str) -> Figure:
    """One of `FIGURES`, which are of no hanger."""
    found = solutions(SOLUTIONS[number])
    return Figure(
        found.figure.title,
        ("xi", *(f"{found.figure.quantity}_{n}" for n in range(1, MODES + 1))),
        [(f"{xi:.4g}", *(f"{value:.4f}" for value in row)) for xi, row in found.rows()],
        found.statement,
        found.document(),
        found.specification(),
        missed=found.statement if found.difference > LIMIT else "",
    )


def solutions(figure: Drawn, points: int = _POINTS) -> Solutions:
    """What a figure shows."""
    xi = np.linspace(figure.low, figure.high, points)
    springs = np.full_like(xi, figure.spring)
    q = wave_numbers(xi**2, springs, springs, MODES)
    omega = q * np.hypot(xi[:, None], q)
    order = np.arange(1, MODES + 1)
    if figure.quantity == "eta":
        values = omega / (order * np.pi * xi[:, None])
    else:
        clamped = np.full(1, np.inf)
        values = omega / wave_numbers(np.zeros(1), clamped, clamped, MODES) ** 2
    off = _distance(q, xi[:, None], figure.spring)
    return Solutions(figure, xi, values, float(off.max()))


def _distance(q: FloatArray, xi: FloatArray, spring: float) -> FloatArray:
    """A Newton step of the thesis's determinant from each root, over that root."""
    step = 1e-5 * q
    here, ahead, behind = (_determinant(each, xi, spring) for each in (q, q + step, q - step))
    slope = (ahead - behind) / (2 * step)
    return np.asarray(np.abs(here / slope / q))


def _determinant(al: FloatArray, xi: FloatArray, spring: float) -> FloatArray:
    """(2.45), whose rows become those of (2.18) for clamped ends, with exp(-bl x) and
    exp(-bl (1 - x)) for sinh(bl x) and cosh(bl x): the same roots, and nothing overflows."""
    bl = np.hypot(xi, al)
    decay, sine, cosine = np.exp(-bl), np.sin(al), np.cos(al)
    zero, one = np.zeros_like(al), np.ones_like(al)
    a, b = al**2 / spring, bl**2 / spring
    rows = [
        [one, decay, zero, one],
        [b + bl, (b - bl) * decay, -al, -a],
        [decay, one, sine, cosine],
        [(b - bl) * decay, b + bl, al * cosine - a * sine, -al * sine - a * cosine],
    ]
    return np.asarray(np.linalg.det(np.moveaxis(np.array(rows), (0, 1), (-2, -1))))
