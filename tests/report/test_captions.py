"""The words beside every figure, letter by letter: `data/captions.txt`.

Who changes them on purpose writes that file anew: `python -m tests.report.test_captions`.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from shm.report.contents import HangerReport
from shm.report.diagnosis_report import FIGURES as OF_DIAGNOSIS
from shm.report.figures.hanger_frequencies import FIGURE as FREQUENCIES
from shm.report.figures.hanger_stiffness import FIGURE as STIFFNESS
from shm.report.figures.hanger_temperature import FIGURE as TEMPERATURE
from shm.report.figures.hanger_trend import FIGURE as TREND
from shm.report.figures.modal_test_axes import ResponseCurves
from shm.report.modal_test_report import FIGURES as OF_MODAL_TEST
from tests.report.conftest import bare, hanger, season
from tests.report.diagnoses import sheet
from tests.report.sheets import SHEETS

OF_HANGER = (TREND, FREQUENCIES, STIFFNESS, TEMPERATURE)
KEPT = Path(__file__).parent / "data" / "captions.txt"


def written(season: HangerReport, bare: HangerReport) -> str:
    """Caption and description of each figure of each report, for data that have it."""
    warned, ambient = (ResponseCurves.of(SHEETS[case]()) for case in ("warned", "ambient"))
    shown: list[tuple[str, Any, Any]] = [
        *(("test", each, warned) for each in OF_MODAL_TEST),
        *(("ambient test", each, ambient) for each in OF_MODAL_TEST),
        *((f"diagnosis, {case}", each, sheet(case)) for case in ("blunder", "alike")
          for each in OF_DIAGNOSIS),
        *(("season", each, season) for each in OF_HANGER),
        *(("first test", each, bare) for each in OF_HANGER),
    ]  # fmt: skip
    return "\n".join(
        line
        for of, member, data in shown
        if member.draw(data) is not None
        for line in _lines(f"{member.name} ({of})", member.caption(data), member.alt(data))
    )


def _lines(name: str, *texts: str) -> Iterator[str]:
    yield f"{name}: "
    for text in texts:
        yield from textwrap.wrap(text, 96, initial_indent="  ", subsequent_indent="    ")
    yield ""


def test_captions_are_as_agreed(season: HangerReport, bare: HangerReport) -> None:
    assert written(season, bare) == KEPT.read_text(encoding="utf-8")


def _plain(fixture: Any) -> Any:
    """Return the function that a fixture calls."""
    return getattr(fixture, "__wrapped__", None) or fixture._fixture_function


if __name__ == "__main__":
    made = _plain(hanger)()
    KEPT.write_text(written(_plain(season)(made), _plain(bare)(made)), encoding="utf-8")
