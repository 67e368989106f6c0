"""Figures 2.3 to 2.7 of the thesis: a beam's dimensionless frequencies against xi = L sqrt(T/EI).

Problem A is clamped, problem B on rotational springs. eta_n is a frequency over that of a string
(2.26), phi_n over that of a clamped beam without tension (2.31). The thesis prints no values beside
its curves; so each point is held against the thesis's own equation, the determinant (2.45).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from shm.models.tensioned_beam import wave_numbers
from shm.report.figures.prediction_figures import Curves, specify
from shm.report.figures.specification import Specification
from shm.values import FloatArray, Hanger
from shm_cli.validation.figure import Figure

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
FIGURES = {
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
            "The thesis does not state its springs; 10 is half way between pinned and clamped.",
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


def shown(hanger: Hanger, tell: Callable[[str, float], None], number: str) -> Figure:
    """One of `FIGURES`, which are of no hanger."""
    found = solutions(FIGURES[number])
    return Figure(
        found.figure.title,
        ("xi", *(f"{found.figure.quantity}_{n}" for n in range(1, MODES + 1))),
        [(f"{xi:.1f}", *(f"{value:.4f}" for value in row)) for xi, row in found.rows()],
        found.statement,
        found.document(),
        found.specification(),
        missed=found.statement if found.difference > LIMIT else "",
    )


def solutions(figure: Drawn, points: int = _POINTS) -> Solutions:
    """What a figure shows."""
    xi = np.linspace(figure.low, figure.high, points)
    springs = np.full_like(xi, figure.spring)
    q = wave_numbers(xi, springs, springs, MODES)
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
