"""What a quality check looks at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from shm.identify.contract import Finding, Measurement, Tone
from shm.identify.options import IdentifyOptions
from shm.values import QualityCheck, Recording


@dataclass(frozen=True, eq=False)
class Inspection:
    """A test before its modes are numbered.

    `records` are the time records, none where frequency responses were given; `measurements` one a
    set-up; `tones` ring steadily in them; `finding` is what the identifier found, None where it has
    not run yet; `cross_check` what a second identifier found, None where none was asked.
    """

    records: Sequence[Recording]
    measurements: Sequence[Measurement]
    options: IdentifyOptions
    tones: Sequence[Tone] = ()
    finding: Finding | None = None
    cross_check: Finding | None = None


class Check(Protocol):
    """Gives one figure of a test's quality; None where the question does not arise."""

    def __call__(self, inspection: Inspection) -> QualityCheck | None: ...
