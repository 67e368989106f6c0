"""Tables 1.1, 5.1 and 6.1 of the thesis: what was measured, and what the classes make of it.

The data of 5.1 and 6.1 are table 1.1, counted ten times (docs/trials/validation.md).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from shm.modes_document import load_modes
from shm.values import PLANES, Hanger, Plane
from tests.benchmarks.thesis import selection, thesis_data

Tell = Callable[[str, float], None]
# As in the thesis, chapter 5: data and N_D.
_PRINTING, _REPEATS = "table 1.1", (10,)


@dataclass(frozen=True, eq=False)
class Shown:
    """A table of the thesis and ours: `cells` stand under `heads`; `document` says the same."""

    heads: tuple[str, ...]
    cells: Sequence[tuple[str, ...]]
    document: Any


def measured(hanger: Hanger, seed: int, tell: Tell) -> Shown:
    """Table 1.1 in both printings."""
    by_printing = {
        printing: {(m.plane, m.order): m.frequency_hz for m in load_modes(path)[0].modes}
        for printing, path in thesis_data.PRINTINGS.items()
    }
    document = [
        {"plane": plane, "order": order}
        | {name: hz[plane, order] for name, hz in by_printing.items()}
        for plane, order in sorted(by_printing[_PRINTING], key=_place)
    ]
    heads = ("plane", "mode", *(f"{name} (Hz)" for name in by_printing))
    cells = [tuple(f"{value}" for value in row.values()) for row in document]
    return Shown(heads, cells, document)


def _place(mode: tuple[Plane, int]) -> tuple[int, int]:
    plane, order = mode
    return PLANES.index(plane), order


def evidence(hanger: Hanger, seed: int, tell: Tell) -> Shown:
    """Table 5.1: only order and differences of its evidences compare."""
    rows = selection.compared(hanger, seed, tell, (_PRINTING,), _REPEATS)
    heads = ("class", "log evidence", "to best", "thesis", "thesis, to best")
    cells = [
        (
            row.model,
            f"{row.log_evidence:.2f} ± {row.log_evidence_sd:.2f}",
            f"{row.log_bayes_factor:.1f}",
            f"{thesis_data.EVIDENCE[row.model]:.2f}",
            f"{row.thesis_log_bayes_factor:.1f}",
        )
        for row in rows
    ]
    return Shown(heads, cells, [asdict(row) for row in rows])


def summary(hanger: Hanger, seed: int, tell: Tell) -> Shown:
    """Table 6.1: evidence, deviation from the nominal tension, time."""
    rows = selection.compared(hanger, seed, tell, (_PRINTING,), _REPEATS)
    heads = (
        "class", "to best", "thesis, to best", "to 711 / 835 kN", "thesis", "time", "thesis, time",
    )  # fmt: skip
    told = [dict(zip(selection.HEADS, selection.cells(row), strict=True)) for row in rows]
    cells = [tuple(each[head] for head in heads) for each in told]
    return Shown(heads, cells, [asdict(row) for row in rows])


TABLES: dict[str, Callable[[Hanger, int, Tell], Shown]] = {
    "1.1": measured,
    "5.1": evidence,
    "6.1": summary,
}
