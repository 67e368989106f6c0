"""Which hypotheses are worth a full fit."""

from __future__ import annotations

from shm.gap.contract import Hypothesis
from shm.gap.fit import varied
from shm.gap.model_probabilities import ScoredHypothesis
from shm.models.effects import Variant


def _pair(log_evidence: float, other: str, at: str) -> ScoredHypothesis:
    return ScoredHypothesis(
        Hypothesis((("sag", Variant()), (other, Variant(at)))), log_evidence, 0.0
    )


def test_many_places_of_one_pair_leave_room_for_other_pairs() -> None:
    crowd = [_pair(10.0 - k, "section_loss", f"{k} m") for k in range(9)]
    other = _pair(-50.0, "bending_stiffness", "everywhere")
    chosen = varied([*crowd, other], alike=2, most=3)
    assert chosen == (crowd[0], crowd[1], other)
    assert varied([*crowd, other], alike=9, most=3) == tuple(crowd[:3])
