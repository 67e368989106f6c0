"""Check a test before it counts: one that is implausible is held.

A check is one function `Candidate -> Doubt | None` and one line of `CHECKS`. It is asked once the
modes of a test are identified, and before anything is computed from them.
"""

from __future__ import annotations

from shm.plausibility import clock, copies
from shm.plausibility.bars import of_another_bar, of_other_signals
from shm.plausibility.candidate import Candidate, Check, implied_shift, notice_of
from shm.plausibility.clock import FIRST_DAY, refuse_impossible
from shm.plausibility.copies import fingerprint_of
from shm.values import Doubt

__all__ = [
    "CHECKS", "FIRST_DAY", "Candidate", "Check", "doubts_about", "fingerprint_of", "implied_shift",
    "notice_of", "refuse_impossible",
]  # fmt: skip

CHECKS: tuple[Check, ...] = (
    clock.before_the_bridge,
    clock.ahead,
    clock.ambiguous,
    clock.scattered,
    clock.stuck,
    clock.before_the_baseline,
    copies.copied,
    of_another_bar,
    of_other_signals,
)

_WITHOUT_MODEL = tuple(each for each in CHECKS if each not in (of_another_bar, of_other_signals))
"""Of a structure that no bar describes, and of a control hanger: what its frequencies say against a
test is what it is there to show (record 0028)."""


def doubts_about(candidate: Candidate) -> tuple[Doubt, ...]:
    """Return the reasons to hold a test, in the order of `CHECKS`; none where it is plausible."""
    by_bar = candidate.hanger.is_modelled and not candidate.hanger.is_control
    checks = CHECKS if by_bar else _WITHOUT_MODEL
    found = [doubt for check in checks if (doubt := check(candidate)) is not None]
    if any(doubt.check == "copy" for doubt in found):  # that explains the same time
        found = [doubt for doubt in found if doubt.check != "clock stuck"]
    return tuple(found)
