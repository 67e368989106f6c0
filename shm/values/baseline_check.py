"""What the tests of a baseline say of each other: what was left out of it, and whether it fits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from shm.values.kinds import Plane
from shm.values.modes import ModalTest


@dataclass(frozen=True)
class MistakenMode:
    """A mode that is left out of a baseline: in `test`, measured and as it was expected, in Hz."""

    test: str
    plane: Plane
    order: int
    measured_hz: float
    expected_hz: float

    def __str__(self) -> str:
        return (
            f"{self.plane} {self.order} of test {self.test}: measured {self.measured_hz:.4g} Hz, "
            f"expected {self.expected_hz:.4g} Hz"
        )


@dataclass(frozen=True)
class MistakenTest:
    """A test that is left out of a baseline as a whole, and why."""

    test: str
    why: str

    def __str__(self) -> str:
        return f"test {self.test}: {self.why}"


@dataclass(frozen=True)
class BaselineCheck:
    """What is left out of a baseline, modes and whole tests, and in what it does not fit.

    `misfit` is a clause, empty where the baseline fits. `unchecked` says why mistakes could not
    have been found, empty where they could.
    """

    modes: tuple[MistakenMode, ...] = ()
    tests: tuple[MistakenTest, ...] = ()
    misfit: str = ""
    unchecked: str = ""

    def kept(self, test: ModalTest) -> ModalTest:
        """A test of the baseline without the modes that are left out."""
        out = {(each.plane, each.order) for each in self.modes if each.test == test.id}
        if not out:
            return test
        modes = tuple(
            mode for mode in test.modes if mode.irregular or (mode.plane, mode.order) not in out
        )
        return replace(test, modes=modes)

    def kept_of(self, tests: Sequence[ModalTest]) -> tuple[ModalTest, ...]:
        """The tests without the modes and the tests that are left out."""
        return tuple(self.kept(test) for test in tests if not self.leaves_out(test.id))

    def leaves_out(self, test: str) -> bool:
        """Whether a test is left out as a whole."""
        return any(each.test == test for each in self.tests)

    @property
    def left_out(self) -> tuple[str, ...]:
        """Each thing that is left out, with the reason."""
        return (*map(str, self.tests), *map(str, self.modes))
