"""Whether the modes of a test are those of the hanger that it is filed under, and its signals what
their channels say."""

from __future__ import annotations

from shm.plausibility.bars import Known, OtherOrigin, doubt_of
from shm.plausibility.candidate import Candidate
from shm.values import Doubt

_ACTIONS = {
    "hanger": "Drop it again with `hanger = {hanger}` in its sidecar, discard it, or confirm it",
    "time base": "Correct {rate} and drop it again, discard it, or confirm it",
    "planes": "Correct the planes in {place} and drop it again, discard it, or confirm it",
}


def of_another_bar(candidate: Candidate) -> Doubt | None:
    """Modes of another hanger, of a wrong time base or of exchanged planes."""
    own = Known(candidate.hanger, tuple(candidate.earlier))
    others = [Known(hanger, tuple(tests)) for hanger, tests in candidate.others]
    found = doubt_of(candidate.test, own, others)
    if found is None or found.kind == "unknown bar":
        return None  # of such a bar the first line of its posterior says that it does not fit
    why = f"The probability that it is not what it is filed as is {found.probability:.2f}."
    state = found.text[0].lower() + found.text[1:]
    return Doubt(f"right {found.kind}", state, _action(candidate, found), why)


def _action(candidate: Candidate, found: OtherOrigin) -> str:
    has_samples = candidate.fingerprint is not None
    return _ACTIONS[found.kind].format(
        hanger=found.hanger,
        rate="the sampling rate in its sidecar" if has_samples else "its frequencies",
        place="its sidecar" if has_samples else "the file",
    )


def of_other_signals(candidate: Candidate) -> Doubt | None:
    """A unit that is wrong by 1000, or an accelerometer in the hammer's place."""
    if not candidate.signals:
        return None
    return Doubt(
        "right signals",
        "; ".join(text.rstrip(".") for text in candidate.signals),
        "Correct units and channels in its sidecar and drop both again, discard it, or confirm it",
        "The hits, the motion after them and the hanger's mass do not fit together.",
    )
