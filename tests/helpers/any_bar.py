"""Recordings that no test of a bar judges: for tests of other things than whose modes they are."""

from __future__ import annotations

import pytest

from shm import plausibility
from shm.plausibility.bars import of_another_bar


def take_any_bar(patch: pytest.MonkeyPatch) -> None:
    """Leaves out the check that doubts which hanger modes are of."""
    others = tuple(check for check in plausibility.CHECKS if check is not of_another_bar)
    patch.setattr(plausibility, "CHECKS", others)
