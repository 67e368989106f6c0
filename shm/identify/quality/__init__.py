"""What can be wrong with a test, each as a figure beside its limit and what to do about it.

A check is one function and one line of `CHECKS`.
"""

from __future__ import annotations

from collections.abc import Sequence

from shm.errors import NotIdentifiable
from shm.identify.quality import of_ambient, of_hits, of_modes, of_signals
from shm.identify.quality.inspection import Check, Inspection
from shm.identify.quality.tones import steady_tones, tones
from shm.values import QualityCheck

__all__ = ["CHECKS", "Check", "Inspection", "assess", "refusal", "tones"]

CHECKS: tuple[Check, ...] = (
    of_hits.hits_used,
    of_hits.double_hits,
    of_signals.units,
    of_signals.clipping,
    of_signals.recorded_window,
    of_signals.cable,
    of_signals.drop_outs,
    of_hits.pre_trigger,
    of_hits.ring_down,
    of_hits.force_spectrum,
    of_modes.coherence,
    of_modes.amplitude_dependence,
    of_modes.drift,
    of_signals.noise,
    of_ambient.stationarity,
    of_ambient.signal_to_noise,
    of_ambient.peaks,
    steady_tones,
    of_hits.repeatability,
    of_modes.agreement,
)


def assess(inspection: Inspection) -> tuple[QualityCheck, ...]:
    """The figures of all checks that apply, in the order of `CHECKS`."""
    found = [check(inspection) for check in CHECKS]
    return tuple(figure for figure in found if figure is not None)


def refusal(checks: Sequence[QualityCheck], source: str) -> NotIdentifiable | None:
    """What to raise for a test that a check refuses; None where none does."""
    refused = [check for check in checks if check.verdict == "refused"]
    if not refused:
        return None
    return NotIdentifiable(
        "; ".join(f"{check.name}: {check.found}" for check in refused) + ".",
        file=source,
        remedy=refused[0].remedy,
    )
