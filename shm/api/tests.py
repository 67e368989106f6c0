"""One test or many, as modes or as what they were identified from."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

from shm.identify import Identification
from shm.values import ModalTest

Test: TypeAlias = ModalTest | Identification
Tests: TypeAlias = Test | Sequence[Test]
"""What `update`, `select` and `diagnose` take."""


def modal_tests(tests: Tests) -> tuple[ModalTest, ...]:
    """The modal tests, one or many."""
    given = (tests,) if isinstance(tests, ModalTest | Identification) else tests
    return tuple(each.test if isinstance(each, Identification) else each for each in given)
