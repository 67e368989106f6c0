"""One decision on which cause leads: the attribution's and the diagnosis's are the same."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.gap.test_answer import attribution, cause
from tests.helpers.diagnoses import MASS, a_diagnosis


@pytest.mark.parametrize(
    ("causes", "no_gap", "leading"),
    [
        # A group outweighs the single cause that is more probable than each member.
        ((("sag", 0.4, None), ("point_mass", 0.3, 0), ("effective_length", 0.25, 0)), 0.01, 1),
        ((("sag", 0.4, None), ("point_mass", 0.2, 0), ("effective_length", 0.1, 0)), 0.01, 0),
        ((("sag", 0.9, None),), 0.06, None),
        ((("sag", 0.02, None),), 0.01, None),
        ((), 0.01, None),
    ],
)
def test_leading_is_decided_once(
    causes: tuple[tuple[str, float, int | None], ...], no_gap: float, leading: int | None
) -> None:
    explanations = [cause(effect, p, None, group) for effect, p, group in causes]
    unexplained = 0.05
    found = attribution(*explanations, no_gap=no_gap, unexplained=unexplained)
    shown = replace(
        a_diagnosis(),
        causes=tuple(
            replace(MASS, effect=effect, probability=p, group=group) for effect, p, group in causes
        ),
        no_gap_probability=no_gap,
        unexplained_probability=unexplained,
    )
    assert found.leads == shown.leads
    if leading is None:
        assert found.leading is shown.leading is None
    else:
        assert found.leading is explanations[leading]
        assert shown.leading is shown.causes[leading]
