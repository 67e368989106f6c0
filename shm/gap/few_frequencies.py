"""Of fewer than four modes: what they can tell, and the tension that they leave open.

A tension alone can follow so few frequencies, whatever the ends are. The baseline's ends hold it
far too closely; what `shm update` finds with ends of any stiffness, averaged over its classes of
beam, does not, and stands for the baseline where there is no gap.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from shm.inference import UpdateOptions, select
from shm.models import applicable, build
from shm.values import FEW_MODES, FloatArray, Hanger, ModalTest

_BEAMS = ("beam1", "beam2", "beam3")


def told_of_few(tests: Sequence[ModalTest], hanger: Hanger) -> str:
    """What so few modes can show; empty where there are more."""
    names = _modes(tests)
    if len(names) >= FEW_MODES:
        return ""
    only = "Only one mode is" if len(names) == 1 else f"Only {len(names)} modes are"
    return (
        f"{only} given ({', '.join(sorted(names))}): {_what_they_do(tests, hanger)}; give at least "
        f"{FEW_MODES}, better eight a plane."
    )


def tension_of_any_ends_n(
    tests: Sequence[ModalTest], hanger: Hanger, seed: int
) -> FloatArray | None:
    """Draws of the tension (draws,) where it alone can follow what few modes were measured, with
    ends of any stiffness; None where there are more or something else holds it.
    """
    if len(_modes(tests)) >= FEW_MODES or _held_by(tests, hanger):
        return None
    names, _ = applicable(hanger, _BEAMS)
    return select(
        tests, [build(name, hanger) for name in names], UpdateOptions(seed=seed)
    ).tension_n


def _modes(tests: Sequence[ModalTest]) -> set[str]:
    return {f"{mode.plane} {mode.order}" for test in tests for mode in test.modes}


def _what_they_do(tests: Sequence[ModalTest], hanger: Hanger) -> str:
    held = _held_by(tests, hanger)
    if held:
        return held
    return (
        "tension alone can follow so few frequencies, so that a gap can hardly show and its cause "
        "cannot; without one the tension is that of `shm update`, with ends of any stiffness"
    )


def _held_by(tests: Sequence[ModalTest], hanger: Hanger) -> str:
    """Why the tension cannot follow the frequencies, so that a gap shows though not its cause."""
    alike = "but most causes look alike in so few frequencies"
    if hanger.nominal_tension_n == 0:
        return f"the bar carries no tension that could follow them, so that a gap can show, {alike}"
    if math.isfinite(hanger.scatter.tension):
        known = f"the tension is known to {100 * hanger.scatter.tension:.2g} %"
        return f"{known}, so that a gap can show, {alike}"
    read_n = {test.tension_read_n for test in tests if math.isfinite(test.tension_read_n)}
    if len(read_n) > 1:
        return (
            "a gap shows only where the frequencies do not change as the tensions that were read "
            "do, and most causes look alike in that"
        )
    return ""
