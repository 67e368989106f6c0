"""Makes the table of docs/gap.md: hanger 3's gap, with end flexibility and without."""

from __future__ import annotations

import math

from shm.bridge import load_hanger
from shm.documents import load_modes
from shm.gap import GapOptions, diagnose
from shm.values import Diagnosis
from shm_cli.thesis import HANGER_FILE, PRINTINGS

_END_FLEXIBILITY = ("rotational_end_flexibility", "translational_end_flexibility")
_CATALOGUES = {
    "all 19 effects": (),
    "without end flexibility": _END_FLEXIBILITY,
    "without stiff zones and length too": (
        *_END_FLEXIBILITY,
        "stiff_end_zones",
        "effective_length",
    ),
}
_HEAD = (
    "catalogue", "likeliest cause", "probability", "with its group", "none of them", "no gap",
    "residuals, rms (%)", "held out (%)", "tension (kN), 90 % interval", "to nominal",
)  # fmt: skip


def hanger_3_table(seed: int = 1) -> str:
    """One row for each catalogue, as a markdown table."""
    hanger = load_hanger(HANGER_FILE)
    tests = load_modes(PRINTINGS["table 1.1"])
    rows = [_HEAD, ("---",) * len(_HEAD)]
    for title, without in _CATALOGUES.items():
        found = diagnose(tests, hanger, GapOptions("beam1", without=without, seed=seed))
        rows.append(_row(title, found, hanger.nominal_tension_n))
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def _row(title: str, found: Diagnosis, nominal_n: float) -> tuple[str, ...]:
    best, shrunk, after = found.causes[0], found.shrinkage, found.tension_after_n
    return (
        title,
        f"{best.effect.replace('_', ' ')} ({' or '.join([best.at, *best.also_at[:2]])})",
        f"{best.probability:.2f}",
        f"{found.claim(best):.2f}",
        f"{found.unexplained_probability:.2f}",
        f"{found.no_gap_probability:.2f}",
        _shrunk(shrunk.rms_before_percent, shrunk.rms_after_percent),
        _shrunk(shrunk.held_out_before_percent, shrunk.held_out_after_percent),
        f"{after.mean / 1e3:.0f} ({after.q05 / 1e3:.0f} to {after.q95 / 1e3:.0f})",
        f"{after.mean / nominal_n - 1:+.0%}",
    )


def _shrunk(before: float, after: float) -> str:
    """Nothing shrinks where nothing is claimed."""
    return f"{before:.2f}" if math.isnan(after) else f"{before:.2f} to {after:.2f}"
