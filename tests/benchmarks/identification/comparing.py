"""The same simulated tests for everybody: what they are given and what their answers are worth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from cases import BAND_HZ, Case, random_case
from numpy.typing import NDArray
from scoring import LEAST_SNR_DB, SAME_MODE

_TOLD_WITHIN = 0.01
_LEFT_OF_DECAY = 0.01
TITLES = {
    "shm": "**shm**",
    "pyoma2": "pyOMA2, SSI and its clustering",
    "h1_peaks": "peaks of the averaged H1",
    "sdypy_told": "sdypy-EMA, told the frequencies within 1 %",
    "sdypy_peaks": "sdypy-EMA, told the peaks of the FRFs",
}
COLUMNS = (
    "", "version", "tests", "found", "false", "median error", "seconds: median", "times ours",
    "no answer",
)  # fmt: skip


def sound_case(seed: int, place: int) -> Case:
    """The sound tests of a seed, counted apart from those with a disturbance."""
    numbers = (number for number in range(10 * place + 20) if number % 5 != 3)
    return random_case(seed, [*numbers][place])


def give(case: Case, path: Path) -> None:
    """Writes what an identifier is given; see `runs/given.py`."""
    recording = case.made.recording
    assert recording.force is not None
    acceleration = np.array([channel.values for channel in recording.accelerations])
    frequency, accelerance = _accelerance(case, acceleration, recording.force.values)
    rng = np.random.default_rng(case.number)
    inside = np.array([truth.frequency_hz for truth in case.truths if truth.in_band])
    np.savez(
        path,
        acceleration=acceleration,
        force=recording.force.values,
        rate=recording.sampling_rate_hz,
        frequency=frequency,
        accelerance=accelerance,
        band=BAND_HZ,
        told=np.sort(inside * (1 + _TOLD_WITHIN * rng.uniform(-1, 1, len(inside)))),
    )


def _accelerance(
    case: Case, acceleration: NDArray[np.float64], force: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    """H1 over the hits, an exponential window down to 1 % on both; up to a tenth above the band."""
    plan = case.plan
    size, lead = plan.samples_per_hit, round(0.4 * plan.sampling_rate_hz)
    window = np.exp(np.log(_LEFT_OF_DECAY) * np.arange(size) / size)
    starts = [round(strike.start_s * plan.sampling_rate_hz) - lead for strike in case.made.strikes]
    whole = [start for start in starts if start + size <= len(force)]
    exciting = np.array([np.fft.rfft(window * force[s : s + size]) for s in whole])
    answering = np.array([np.fft.rfft(window * acceleration[:, s : s + size]) for s in whole])
    estimate = np.einsum("hl,hcl->cl", exciting.conj(), answering) / np.sum(
        np.abs(exciting) ** 2, axis=0
    )
    frequency = np.fft.rfftfreq(size, 1 / plan.sampling_rate_hz)
    kept = frequency <= 1.1 * BAND_HZ[1]
    return frequency[kept], estimate[:, kept]


@dataclass(frozen=True)
class Worth:
    """Of one answer; errors are relative."""

    expected: int
    found: int
    reported: int
    false: int
    errors: tuple[float, ...]


def worth(case: Case, frequency_hz: Sequence[float]) -> Worth:
    """By frequency alone: peers give neither plane nor order. One answer is one mode's, at most."""
    left = [f for f in frequency_hz if BAND_HZ[0] < f < BAND_HZ[1]]
    reported, errors, found, expected = len(left), [], 0, 0
    for truth in sorted(case.truths, key=lambda each: -each.snr_db):
        counts = truth.in_band and truth.snr_db >= LEAST_SNR_DB
        expected += counts
        near = [f for f in left if abs(f / truth.frequency_hz - 1) < SAME_MODE]
        if near:
            own = min(near, key=lambda f: abs(f - truth.frequency_hz))
            left.remove(own)
            found += counts
            errors.append(abs(own / truth.frequency_hz - 1))
    return Worth(expected, found, reported, len(left), tuple(errors))


def rows(answers: dict[str, dict[int, dict[str, Any]]], seed: int) -> list[tuple[str, ...]]:
    """One row of `COLUMNS` an identifier; a test without an answer has found nothing."""
    cases = {place: sound_case(seed, place) for own in answers.values() for place in own}
    ours = _seconds(answers.get("shm", {}))
    made = []
    for name, own in answers.items():
        worths = [worth(cases[p], line.get("frequency_hz", ())) for p, line in own.items()]
        errors = [error for each in worths for error in each.errors]
        expected, found = sum(w.expected for w in worths), sum(w.found for w in worths)
        failed = sum("failure" in line for line in own.values())
        made.append((
            TITLES[name],
            next((line["version"] for line in own.values() if "version" in line), "-"),
            str(len(own)),
            f"{found} of {expected} ({100 * found / max(expected, 1):.0f} %)",
            f"{sum(w.false for w in worths)} of {sum(w.reported for w in worths)}",
            f"{100 * float(np.median(errors)):.4f} %" if errors else "-",
            f"{_seconds(own):.2f}",
            f"{_seconds(own) / ours:.1f}",
            str(failed),
        ))  # fmt: skip
    return made


def _seconds(own: dict[int, dict[str, Any]]) -> float:
    """Median processor time; one that ran into its limit counts with that."""
    seconds = [line.get("seconds", math.nan) for line in own.values()]
    return float(np.nanmedian(seconds)) if seconds else math.nan
