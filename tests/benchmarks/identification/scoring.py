"""What one identified test is worth beside its truth."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

from cases import BAND_HZ, Case, Truth, heard_db, random_case

from shm.errors import NotIdentifiable
from shm.identify import Identification, IdentifyOptions, identify
from shm.values import Mode
from tests.worlds.simulated.disturbances.base import Planted

LEAST_SNR_DB = 20.0
SAME_ORDER = 0.02
SAME_MODE = 0.003
SAME_HIT_S = 0.05
FOREIGN = ("harmonic", "deck")

CHECKS = {
    "double_hit": ("double hits",),
    "clipping": ("clipping",),
    "overload": ("clipping",),
    "cable": ("cable", "drop-outs"),
    "drop_out": ("drop-outs",),
    "no_pre_trigger": ("pre-trigger",),
    "cut_off": ("ring-down",),
    "soft_hit": ("force spectrum",),
    "mains": ("tones",),
    "machine": ("tones",),
    "outlier_hit": ("repeatability",),
}
"""Quality checks of which one must not be good where a disturbance was planted."""


@dataclass
class TestScore:
    """Counts and errors of one test; frequency and damping errors are relative."""

    number: int
    disturbance: str = ""
    refused: str = ""
    seconds: float = math.nan
    expected: int = 0
    found: int = 0
    merged_expected: int = 0
    merged_found: int = 0
    reported: int = 0
    false: int = 0
    misplaced: int = 0
    sound_hits: int = 0
    sound_hits_dropped: int = 0
    flagged: bool | None = None
    alarms: list[str] = field(default_factory=list)
    frequency_errors: list[float] = field(default_factory=list)
    frequency_z: list[float] = field(default_factory=list)
    damping_errors: list[float] = field(default_factory=list)
    damping_z: list[float] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)


def score_number(seed: int, number: int, disturbance: str | None = None) -> TestScore:
    """Simulates, identifies and scores one test."""
    return scored(random_case(seed, number, disturbance))


def scored(case: Case) -> TestScore:
    score = TestScore(case.number, case.planted.disturbance if case.planted else "")
    result = _identified(case, score)
    _score_modes(score, case, list(result.test.modes) if result else [])
    if result:
        _score_hits(score, case, result)
        score.alarms = [q.name for q in result.quality if q.verdict in ("warning", "refused")]
    if case.planted:
        score.flagged = _flagged(score, case, case.planted, result)
        if score.flagged is False:
            score.remarks.append(f"not flagged: {case.planted}; checks: {score.alarms}")
    score.remarks = [f"{case.label}: {remark}" for remark in score.remarks]
    return score


def _identified(case: Case, score: TestScore) -> Identification | None:
    began = time.process_time()
    try:
        return identify(
            [case.made.recording],
            IdentifyOptions(*BAND_HZ),
            test_id=f"t{case.number}",
            hanger=case.hanger,
        )
    except NotIdentifiable as error:
        score.refused = str(error)
        score.remarks.append(f"refused: {error}")
        return None
    finally:
        score.seconds = time.process_time() - began


def _score_modes(score: TestScore, case: Case, modes: list[Mode]) -> None:
    """Modes are matched by plane and order first, then by frequency: those are misplaced."""
    score.reported = len(modes)
    for truth in sorted(case.truths, key=lambda t: -t.snr_db):
        own = _of_order(modes, truth)
        _count(score, truth, own is not None)
        if own is not None:
            modes.remove(own)
            _add_errors(score, truth, own, case.state.damping_ratio)
    for mode in modes:
        near = _nearest(case.truths, mode)
        if near:
            score.misplaced += 1
            score.remarks.append(f"{near} is called {_words(mode)}")
        else:
            score.false += 1
            score.remarks.append(f"false {_words(mode)}")


def _of_order(modes: Sequence[Mode], truth: Truth) -> Mode | None:
    for mode in modes:
        if (mode.plane, mode.order) == (truth.plane, truth.order):
            near = abs(mode.frequency_hz / truth.frequency_hz - 1) < SAME_ORDER
            return mode if near else None
    return None


def _nearest(truths: Sequence[Truth], mode: Mode) -> Truth | None:
    near = [t for t in truths if abs(mode.frequency_hz / t.frequency_hz - 1) < SAME_MODE]
    return min(near, key=lambda t: abs(t.frequency_hz - mode.frequency_hz), default=None)


def _words(mode: Mode) -> str:
    return (
        f"{mode.plane} {mode.order} {mode.frequency_hz:.4f} Hz, damping {mode.damping_ratio:.4f}, "
        f"sd {mode.frequency_sd_hz:.5f}"
    )


def _count(score: TestScore, truth: Truth, found: bool) -> None:
    unusable = score.disturbance == "noise_only"
    if truth.snr_db < LEAST_SNR_DB or not truth.in_band or truth.under_tone or unusable:
        return
    score.expected += 1
    score.found += found
    score.merged_expected += truth.merged
    score.merged_found += truth.merged and found
    if not found and not score.refused:
        score.remarks.append(f"missed {truth}")


def _add_errors(score: TestScore, truth: Truth, mode: Mode, damping: float) -> None:
    error = mode.frequency_hz / truth.frequency_hz - 1
    score.frequency_errors.append(error)
    score.frequency_z.append((mode.frequency_hz - truth.frequency_hz) / mode.frequency_sd_hz)
    score.damping_errors.append(mode.damping_ratio / damping - 1)
    score.damping_z.append((mode.damping_ratio - damping) / mode.damping_sd)
    if abs(error) > SAME_MODE:
        score.remarks.append(f"{truth}: {_words(mode)} is {error:+.3%} off")


def _score_hits(score: TestScore, case: Case, result: Identification) -> None:
    """Hits without a planted fault that are not used; one that was not seen counts, too."""
    faulty = case.planted.hits if case.planted else ()
    for index, strike in enumerate(case.made.strikes):
        if index in faulty:
            continue
        seen = [h for h in result.hits if abs(h.start_s - strike.start_s) < SAME_HIT_S]
        score.sound_hits += 1
        if not any(hit.used for hit in seen):
            score.sound_hits_dropped += 1
            reason = seen[0].reason if seen else "not seen"
            score.remarks.append(f"sound hit {index} dropped: {reason}")


def _flagged(
    score: TestScore, case: Case, planted: Planted, result: Identification | None
) -> bool | None:
    """Whether a planted fault was told; None where it could not be heard."""
    if planted.disturbance == "noise_only":
        return result is None
    if planted.disturbance in FOREIGN:
        return _set_aside(case, planted, result)
    names = CHECKS[planted.disturbance]
    if any(name in names for name in score.alarms):
        return True
    return _hits_told(case, planted, result) or _refusal_tells(score, names)


def _refusal_tells(score: TestScore, names: Sequence[str]) -> bool:
    return any(name.rstrip("s") in score.refused for name in names)


def _hits_told(case: Case, planted: Planted, result: Identification | None) -> bool:
    """Every hit with the fault was dropped for some reason."""
    strikes = [case.made.strikes[hit] for hit in planted.hits]
    dropped = [hit for hit in result.hits if not hit.used] if result else []
    return bool(strikes) and all(
        any(abs(hit.start_s - strike.start_s) < SAME_HIT_S for hit in dropped) for strike in strikes
    )


def _set_aside(case: Case, planted: Planted, result: Identification | None) -> bool | None:
    """One below 20 dB counts only where it was taken for a mode of the hanger."""
    under_a_mode = any(_same(truth.frequency_hz, planted) for truth in case.truths)
    if under_a_mode or not BAND_HZ[0] < planted.frequency_hz < BAND_HZ[1]:
        return None
    aside = result.set_aside if result else ()
    if any(m.kind == planted.disturbance and _same(m.frequency_hz, planted) for m in aside):
        return True
    modes = result.test.modes if result else ()
    taken = any(_same(mode.frequency_hz, planted) for mode in modes)
    return False if taken or heard_db(planted, case) >= LEAST_SNR_DB else None


def _same(frequency_hz: float, planted: Planted) -> bool:
    return abs(frequency_hz / planted.frequency_hz - 1) < 2 * SAME_MODE
