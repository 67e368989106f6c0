"""Make the table of docs/trials/real_cases.md: hanger 3 by several baselines and catalogues."""

from __future__ import annotations

import math

from shm.bridge import load_hanger
from shm.gap import GapOptions, diagnose
from shm.models.effects import EFFECTS
from shm.modes_document import load_modes
from shm.values import Diagnosis, TensionEstimate
from shm_cli.common import markdown
from shm_cli.example import HANGER_FILE, MODES_FILE

_END_FLEXIBILITY = ("rotational_end_flexibility", "translational_end_flexibility")
_ALL = f"all {len(EFFECTS)} effects"
_CASES = (
    ("", _ALL, ()),
    ("beam1", _ALL, ()),
    ("beam1", "without end flexibility", _END_FLEXIBILITY),
    (
        "beam1",
        "without stiff zones and length too",
        (*_END_FLEXIBILITY, "stiff_end_zones", "effective_length"),
    ),
    ("solid0", _ALL, ()),
    ("solid0", "without end flexibility", _END_FLEXIBILITY),
)
_HEAD = (
    "baseline", "catalogue", "likeliest cause", "probability", "with its group", "none of them",
    "no gap", "residuals, rms (%)", "held out (%)", "tension (kN): baseline", "weighed over all",
)  # fmt: skip


def hanger_3_table(seed: int = 1) -> str:
    """One row for each baseline and catalogue, as a markdown table."""
    hanger = load_hanger(HANGER_FILE)
    tests = load_modes(MODES_FILE)
    rows = []
    for baseline, catalogue, without in _CASES:
        found = diagnose(tests, hanger, GapOptions(baseline, without=without, seed=seed))
        rows.append((baseline or f"preferred: {found.baseline}", catalogue, *_row(found)))
    return markdown(_HEAD, rows)


def _row(found: Diagnosis) -> tuple[str, ...]:
    best, shrunk = found.causes[0], found.shrinkage
    return (
        f"{best.effect.replace('_', ' ')} ({best.at}{' or elsewhere' if best.also_at else ''})",
        f"{best.probability:.2f}",
        f"{found.claim(best):.2f}",
        f"{found.unexplained_probability:.2f}",
        f"{found.no_gap_probability:.2f}",
        _shrunk(shrunk.rms_before_percent, shrunk.rms_after_percent),
        _shrunk(shrunk.held_out_before_percent, shrunk.held_out_after_percent),
        _tension(found.tension_before_n),
        _tension(found.tension_after_n),
    )


def _tension(found: TensionEstimate) -> str:
    return f"{found.mean / 1e3:.0f} ({found.q05 / 1e3:.0f} to {found.q95 / 1e3:.0f})"


def _shrunk(before: float, after: float) -> str:
    """Nothing shrinks where nothing is claimed."""
    return f"{before:.2f}" if math.isnan(after) else f"{before:.2f} to {after:.2f}"
