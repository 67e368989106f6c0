"""Formulas of practice: the tension of a bar from one measured frequency, in closed form.

Each is T = 4 m (f_n L / n)^2 (a - b C / f_n - c (C / f_n)^2), C = sqrt(EI / m) / L^2: a string's
tension and what bending takes off it. Sag is left out: hangers stand upright, or nearly so.

A formula may fall into ranges of xi = L sqrt(T/EI) with coefficients of their own. The papers were
not at hand; their coefficients were held against the exact clamped beam (tests/models/
test_practice_formulas.py): without tension they give 0 within 2 EI/L^2, over their range the errors
that `worst_error` states. Fang and Wang (2012) is not among them: its coefficients could be checked
neither against the paper nor by a limit. Ceballos and Prato (2008) take several frequencies:
`shm.models.classes.equal_springs`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

Ranges = tuple[tuple[float, float, float, float], ...]


@dataclass(frozen=True)
class PracticeFormula:
    """A formula from the frequency of one `order`.

    `ranges` are (lowest xi, a, b, c), highest xi first. Of xi from `valid_from_xi` on,
    `worst_error` bounds the error of the tension, as a fraction, on the exact beam with the ends
    that it supposes, by `tests/models/test_practice_formulas.py`.
    """

    name: str
    source: str
    order: int
    ranges: Ranges
    ends: str
    leaves_out: str
    valid_from_xi: float
    worst_error: float

    def tension_n(
        self,
        frequency_hz: float,
        length_m: float,
        mass_per_length_kg_m: float,
        bending_stiffness_n_m2: float,
    ) -> float:
        """Return the tension; negative where bending alone would give a higher frequency."""
        string = 4 * mass_per_length_kg_m * (frequency_hz * length_m / self.order) ** 2
        ratio = math.sqrt(bending_stiffness_n_m2 / mass_per_length_kg_m) / length_m**2
        ratio /= frequency_hz
        tension = math.nan
        for lowest, a, b, c in self.ranges:
            tension = string * (a - b * ratio - c * ratio**2)
            # Without bending stiffness xi is infinite; the comparison of squares holds then too.
            if tension * length_m**2 >= lowest**2 * bending_stiffness_n_m2:
                break
        return tension


_NO_SPRINGS = "springs at the ends"

FORMULAS = (
    PracticeFormula(
        "taut string",
        "textbook",
        1,
        ((0.0, 1.0, 0.0, 0.0),),
        "any",
        "bending stiffness and the ends",
        100.0,  # Below, what it leaves out is of the order of 4 / xi.
        0.05,
    ),
    PracticeFormula(
        "pinned beam",
        "textbook, exact",
        1,
        ((0.0, 1.0, 0.0, math.pi**2 / 4),),  # T = 4 m f^2 L^2 - pi^2 EI / L^2
        "pinned",
        "any fixity of the ends",
        0.1,
        1e-6,
    ),
    PracticeFormula(
        "Zui, first order",
        "Zui, Shinke and Namita 1996, J. Struct. Eng. 122, 651",
        1,
        ((17.0, 1.0, 2.20, 0.550), (6.0, 0.865, 0.0, 11.6), (0.0, 0.828, 0.0, 10.5)),
        "clamped",
        _NO_SPRINGS,
        3.0,
        0.03,
    ),
    PracticeFormula(
        "Zui, second order",
        "Zui, Shinke and Namita 1996, J. Struct. Eng. 122, 651",
        2,
        ((60.0, 1.0, 4.40, 1.10), (17.0, 1.03, 6.33, 1.58), (0.0, 0.882, 0.0, 85.0)),
        "clamped",
        _NO_SPRINGS,
        3.0,
        0.05,
    ),
    PracticeFormula(
        "Ren",
        "Ren, Chen and Hu 2005, Struct. Eng. Mech. 20, 363",
        1,
        (
            (210.0, 1.0, 0.0, 0.0),
            (18.0, 1.0, 2.363, -(2.363**2) / 4),  # m (2 L f - 2.363 sqrt(EI/m) / L)^2
            (0.0, 3.432 / 4, 0.0, 45.191 / 4),  # 3.432 m f^2 L^2 - 45.191 EI/L^2
        ),
        "clamped",
        _NO_SPRINGS,
        5.0,
        0.025,
    ),
)  # fmt: skip
