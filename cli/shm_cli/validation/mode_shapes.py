"""Figures B.1 to B.14 of the thesis: modes 1 to 7 of "Model 4", the solid on springs, x and y."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from shm.models import THESIS, build
from shm.models.solid.classes import SolidModel
from shm.report.figures.prediction_figures import write_deformed_png as write_png
from shm.values import PLANES, Hanger, Plane
from shm_cli.validation import frequencies
from shm_cli.validation.figure import Figure

# Thesis, appendix B: seven orders, x before y.
FIGURES: dict[str, tuple[int, Plane]] = {
    f"B.{2 * order - 1 + place}": (order, plane)
    for order in range(1, 8)
    for place, plane in enumerate(PLANES)
}
_TOLD = 13  # places along the hanger in the table: each metre of hanger 3


def shown(hanger: Hanger, tell: Callable[[str, float], None], number: str) -> Figure:
    """Class 1 at nominal tension, its springs as stiff as a clamp: they are not stated."""
    order, plane = FIGURES[number]
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
        draw=lambda path, words: write_png(corners, moved, path, words),
    )
