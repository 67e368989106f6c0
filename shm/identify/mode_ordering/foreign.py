"""Say why a vibration in a test is no bending mode of the hanger.

A tone is known by its frequency and by not decaying. Anything else is foreign only if it fits no
order of the hanger: a string's modes are close to multiples of each other, too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product
from typing import Literal

import numpy as np

from shm.identify.contract import FoundMode, Tone
from shm.identify.estimation.shapes import modal_assurance
from shm.values import ForeignMode, Plane

MULTIPLES = (2, 3)  # judgement: rattling contacts give the first two, higher ones are fainter
_MULTIPLE_TOLERANCE = 5e-4  # judgement: it is exact but for the drift within a test
_TONE_TOLERANCE = 2e-3  # half of what a grid moves in a bad hour, see `tones`
_STANDARD_DEVIATIONS = 3.0  # 99.7 % of a normal distribution
# Modes of a hanger have 0.73 of the others' damping and more, the median planted tone 0.003:
# identify_limits.py (docs/trials/identification_benchmarks.md); in between is judgement
_STEADY = 0.1
_LIKE = 0.9  # judgement: modal assurance criterion of a shape that is repeated
_NEAR = 0.03  # judgement: words alone depend on it


def without_tones(
    found: Sequence[FoundMode], tones: Sequence[Tone], *, unordered: bool = False
) -> tuple[list[FoundMode], list[ForeignMode]]:
    """Return the modes that are none of the `tones`, and those that are.

    A mode is a tone where it is at one and hardly decays compared with the other modes; where
    no order could tell that it is one (`unordered`), either is enough.
    """
    rest, foreign = [], []
    for mode in found:
        tone = next((tone for tone in tones if _are_near(mode, tone.frequency_hz)), None)
        steady = _is_steady(mode, found)
        if tone and (steady or unordered):
            decay = " and hardly decays" if steady else ""
            reason = f"It lies at {tone.frequency_hz:.4g} Hz ({tone.name}){decay}."
            foreign.append(_foreign("tone", mode, reason))
        elif steady and unordered:
            foreign.append(_foreign("tone", mode, _driven(mode)))
        else:
            rest.append(mode)
    return rest, foreign


def explain_foreign(
    mode: FoundMode, modes: Sequence[FoundMode], hanger_modes: Sequence[FoundMode]
) -> ForeignMode:
    """Return a mode without order as foreign; `modes` are all, `hanger_modes` have orders."""
    if _is_steady(mode, modes):
        return _foreign("tone", mode, _driven(mode))
    for fold, base in product(MULTIPLES, hanger_modes):
        if _repeats(mode, fold, base):
            reason = (
                f"It is {fold} times the mode at {base.frequency_hz:.3f} Hz, and no order of the "
                "hanger lies there."
            )
            return _foreign("harmonic", mode, reason)
    near = min(hanger_modes, key=lambda each: abs(each.frequency_hz - mode.frequency_hz))
    if abs(near.frequency_hz / mode.frequency_hz - 1) >= _NEAR:
        reason = "No order of the hanger lies there: the bridge or another neighbour moves it."
        return _foreign("deck", mode, reason)
    reason = (
        f"A hanger has one mode a plane near {near.frequency_hz:.2f} Hz, and another fits better: "
        "this is a neighbour's motion, or the other plane's mode seen askew."
    )
    return _foreign("deck", mode, reason)


def cross_axis_mode(mode: FoundMode, order: int) -> ForeignMode:
    """Return a mode of the plane that no sensor measures, of that order."""
    reason = (
        f"It is order {order} of the other plane, which the sensors hear askew, or a neighbour's "
        "motion near it."
    )
    return _foreign("deck", mode, reason)


def unnumbered_mode(mode: FoundMode, plane: Plane | None, order: int | None) -> ForeignMode:
    """Return a mode that may be of that order, or of another; None if no mode has an order."""
    reason = "The modes fit neither the hanger's description nor any tensioned bar."
    if order:
        reason = f"Its order may be {order}, another fits nearly as well: it is not guessed."
    return ForeignMode(
        "unnumbered", mode.frequency_hz, mode.damping_ratio, reason,
        plane, mode.frequency_sd_hz, mode.damping_sd,
    )  # fmt: skip


def _foreign(
    kind: Literal["harmonic", "tone", "deck"], mode: FoundMode, reason: str
) -> ForeignMode:
    return ForeignMode(kind, mode.frequency_hz, mode.damping_ratio, reason)


def _driven(mode: FoundMode) -> str:
    return f"It hardly decays (damping {mode.damping_ratio:.4%}): something that runs drives it."


def _repeats(mode: FoundMode, fold: int, base: FoundMode) -> bool:
    """Return whether a mode is a weaker multiple of another, with its shape."""
    sd = math.hypot(np.nan_to_num(mode.frequency_sd_hz), fold * np.nan_to_num(base.frequency_sd_hz))
    expected = fold * base.frequency_hz
    allowed = max(_MULTIPLE_TOLERANCE * expected, _STANDARD_DEVIATIONS * sd)
    return (
        abs(mode.frequency_hz - expected) <= allowed
        and not mode.acceleration_m_s2 > base.acceleration_m_s2
        and modal_assurance(mode.shape, base.shape) >= _LIKE
    )


def _are_near(mode: FoundMode, tone_hz: float) -> bool:
    sd_hz = float(np.nan_to_num(mode.frequency_sd_hz))
    allowed = max(_TONE_TOLERANCE * tone_hz, _STANDARD_DEVIATIONS * sd_hz)
    return abs(mode.frequency_hz - tone_hz) <= allowed


def _is_steady(mode: FoundMode, modes: Sequence[FoundMode]) -> bool:
    """Return True if its damping is a small part of the others'."""
    others = [each.damping_ratio for each in modes if each is not mode]
    return bool(others) and mode.damping_ratio < _STEADY * float(np.median(others))
