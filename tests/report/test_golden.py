"""Every mark of every figure and every cell of every paper as they were agreed: `data/golden.json`.

Kept are checksums, one for each panel and each part, of what they say with five digits. Who changes
them on purpose looks at a figure or a page and writes that file anew:
`python -m tests.report.test_golden`.
"""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields, replace
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np

from shm.report.bridge_diagnosis_report import bridge_diagnosis_paper
from shm.report.contents import BridgeDiagnosisSheet, HangerReport
from shm.report.figures import (
    compared_hangers,
    gap_shared,
    parameter_pairs,
    stream_course,
)
from shm.report.figures.every_figure import OF_TRIAL
from shm.report.figures.hanger_states import FIGURE as STATES
from shm.report.figures.modal_test_spectra import Shown
from shm.report.figures.modal_test_time_history import FIGURE as TIME_HISTORY
from shm.report.figures.specification import Specification
from shm.report.hanger_report import hanger_paper
from shm.report.intervals import Interval
from shm.report.paper import Paper
from shm.report.structure_report import StructureReport, structure_json, structure_paper
from shm.values import BridgeDiagnosis
from shm.values.stream import StreamEvent
from shm.watch.history import Band
from tests.gap.test_shared_causes import bridge
from tests.report.conftest import START, bare, hanger, season
from tests.report.sheets import make_sheet
from tests.report.test_captions import _plain
from tests.report.test_drift_figure import data as states
from tests.report.test_hovers import specifications
from tests.report.test_paper import KINDS
from tests.report.test_trial_page import make_score

KEPT = Path(__file__).parent / "data" / "golden.json"
HOUR = timedelta(hours=1)


def stream() -> stream_course.Course:
    """Ten hours with a gap, two modes of which one is lost, a sensor that fails."""
    rng = np.random.default_rng(2)
    hours = [START + n * HOUR for n in (0, 1, 2, 3, 8, 9, 10)]
    hz = 5.8 + 0.01 * rng.random(7)
    shift = np.linspace(-0.5, 0.4, 7)
    events = [
        StreamEvent("h3", kind, START + 2 * HOUR, START + length, "no signal")
        for kind, length in (("dead", 2 * HOUR), ("gap", 3 * HOUR), ("drifting", 4 * HOUR))
    ]
    return stream_course.Course(
        "h3",
        [START + n * HOUR / 6 for n in range(1300)],
        np.linspace(0, 50, 6),
        rng.random((1300, 6)),
        hours,
        {
            "T1": (hz, np.full(7, 0.01)),
            "L2": (np.where(np.arange(7) > 2, np.nan, 2 * hz), np.full(7, 0.02)),
            "never": (np.full(7, np.nan), np.full(7, 0.02)),
        },
        Band(shift - 0.2, shift, shift + 0.3),
        events,
    )


def courses() -> list[compared_hangers.Course]:
    times = [START + n * timedelta(days=30) for n in range(5)]
    names = [f"t{n}" for n in range(5)]
    shifts = [Interval(0.01 * n, 0.01 * n - 0.004, 0.01 * n + 0.005) for n in range(5)]
    return [
        compared_hangers.Course("hanger 3", times, names, shifts),
        compared_hangers.Course("hanger 4", times[:2], names[:2], shifts[1:3]),
    ]


def family() -> BridgeDiagnosis:
    """Four hangers of six are too heavy."""
    return bridge((8, 8, 0.05, 8, 0.05, 8), (0.05, 0.052, 0.02, 0.048, 0.02, 0.051))


def figures(season: HangerReport, bare: HangerReport) -> Iterator[tuple[str, Specification]]:
    """Those that a screen draws, and those of which no other test asks every number."""
    yield from specifications(season)
    score = make_score("plausible")
    made: list[tuple[str, Any]] = [(each.name, each.draw(score)) for each in OF_TRIAL]
    near = make_sheet()
    records = tuple(
        replace(each, channels=tuple(replace(c, full_scale=float(np.abs(c.values).max()) / 0.8)
                                     for c in each.channels))
        for each in near.records
    )  # fmt: skip
    near_full_scale = Shown.of(replace(near, records=records))
    made.append(("near full scale", TIME_HISTORY.draw(near_full_scale)))
    course = stream()
    # Of equal likelihoods each processor sorts others first.
    posterior = replace(season.posterior, log_likelihood=np.linspace(-9, 0, 1000))
    made += [
        ("states", STATES.draw(replace(season, states=_plain(states)()))),
        ("shared cause", gap_shared.FIGURE.draw(family())),
        ("stream", stream_course.specify(course)),
        ("stream without tension", stream_course.specify(_untold(course))),
        ("compared hangers", compared_hangers.specify(courses())),
        ("marginals", parameter_pairs.marginals(posterior, posterior.names[:2])),
        ("pair", parameter_pairs.pair(posterior, *posterior.names[:2])),
    ]
    yield from ((name, each) for name, each in made if isinstance(each, Specification))


def _untold(course: stream_course.Course) -> stream_course.Course:
    unknown = np.full(7, np.nan)
    none = np.empty((0, 0))
    return replace(course, tension=Band(unknown, unknown, unknown), spectrum_db=none)


def words(season: HangerReport) -> Iterator[tuple[str, str]]:
    course = stream()
    for name, each in (("tension", course), ("no tension", _untold(course))):
        yield f"stream, {name}", stream_course.caption(each) + stream_course.alt(each)
    compared = courses()
    yield "compared", compared_hangers.caption(compared) + compared_hangers.alt(compared)


def told(value: Any) -> str:
    """With five digits: the last ones differ between processors."""
    if isinstance(value, float | np.floating):
        number = float(value)
        return "nan" if math.isnan(number) else f"{0.0 if abs(number) < 1e-9 else number:.5g}"
    if isinstance(value, str | int | np.integer | np.bool_) or value is None:
        return str(value)
    if hasattr(value, "__dataclass_fields__"):
        own = (f"{f.name}={told(getattr(value, f.name))}" for f in fields(value))
        return f"{type(value).__name__}({', '.join(own)})"
    if isinstance(value, np.ndarray) and value.dtype.kind == "f" and value.size > 9:
        known = value[np.isfinite(value)]
        some = known[:: max(1, known.size // 5)]
        return told([value.size, known.size, known.mean(), known.std(), *some])
    if isinstance(value, np.ndarray | Sequence):
        return f"[{' '.join(map(told, value))}]"
    return "drawn" if callable(value) else str(value)


def _structure(season: HangerReport, *, watched: bool) -> StructureReport:
    drift = replace(season.drifts[0], quantity="f1", shift_mean=-0.021)
    return StructureReport(
        "Arch", replace(season.hanger, kind="any"), 12, START if watched else None,
        START if watched else None, {"f1": 1.23456, "f2": 2.5}, "It moved." if watched else "",
        (drift,) if watched else (), season.alerts if watched else (), int(watched), START, "0.1.0",
    )  # fmt: skip


def papers(season: HangerReport) -> Iterator[tuple[str, Paper]]:
    yield from ((kind, make(season)) for kind, make in KINDS.items())
    yield "bridge diagnosis", bridge_diagnosis_paper(BridgeDiagnosisSheet(family(), "Arch"))
    alone = bridge((0.1, 0.2, 0.1), (0.05, 0.01, 0.02))
    yield "structure", structure_paper(_structure(season, watched=True))
    yield "structure not watched", structure_paper(_structure(season, watched=False))
    changed = tuple(f"{name} 1 -> 2" for name in ("area", "length", "mass", "modulus", "plate"))
    outdated = replace(season, redescribed=changed, discarded=("t001", "t002"))
    yield "outdated baseline", hanger_paper(outdated)
    yield "no shared cause", bridge_diagnosis_paper(BridgeDiagnosisSheet(alone, "Arch"))


def found(season: HangerReport, bare: HangerReport) -> dict[str, str]:
    """Checksums by figure or paper, those of its panels or parts in order."""

    def sums(parts: Sequence[Any]) -> str:
        return " ".join(f"{zlib.crc32(told(each).encode()):08x}" for each in parts)

    made = {
        f"figure {name}": sums([(each.height_inches, each.legend_columns), *each.panels])
        for name, each in figures(season, bare)
    }
    made |= {f"words {name}": sums([each]) for name, each in words(season)}
    documents = [structure_json(_structure(season, watched=each)) for each in (True, False)]
    made["structure as JSON"] = sums([json.dumps(each, default=str) for each in documents])
    for name, paper in papers(season):
        made[f"paper {name}"] = sums([replace(paper, parts=()), *paper.parts])
    return made


def test_figures_and_papers_say_what_was_agreed(season: HangerReport, bare: HangerReport) -> None:
    kept = json.loads(KEPT.read_text(encoding="utf-8"))
    made = found(season, bare)
    assert {name for name in made if made[name] != kept.get(name)} == set()
    assert made.keys() == kept.keys()


def main(made: Callable[..., dict[str, str]] = found) -> None:
    report = _plain(season)(_plain(hanger)())
    text = json.dumps(made(report, _plain(bare)(_plain(hanger)())), indent=0)
    KEPT.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
