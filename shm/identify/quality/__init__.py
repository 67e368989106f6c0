"""What can be wrong with a test, each as a figure beside its limit and what to do about it.

A check is one file and one line of `CHECKS`.
"""

from __future__ import annotations

from collections.abc import Sequence

from shm.errors import NotIdentifiable
from shm.identify.quality import (
    cable,
    clipping,
    coherence,
    cross_check,
    double_hits,
    drop_outs,
    force_spectrum,
    hits,
    noise,
    pre_trigger,
    repeatability,
    ring_down,
)
from shm.identify.quality import tones as steady
from shm.identify.quality.inspection import Check, Inspection
from shm.identify.quality.tones import tones
from shm.values import QualityCheck

__all__ = ["CHECKS", "Check", "Inspection", "assess", "refusal", "tones"]

CHECKS: tuple[Check, ...] = (
    hits.check,
    double_hits.check,
    clipping.check,
    cable.check,
    drop_outs.check,
    pre_trigger.check,
    ring_down.check,
    force_spectrum.check,
    coherence.check,
    noise.check,
    steady.check,
    repeatability.check,
    cross_check.check,
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
