"""Sensors stand on the hanger: what is said to be off it is mistyped."""

from __future__ import annotations

from collections.abc import Sequence

from shm.errors import BadInput
from shm.values import FrequencyResponse, Hanger, Recording

_ROUNDED = (
    0.01  # judgement: a place that was taped at the very end, beside a length that was rounded
)


def fault_of_place(x_m: float, hanger: Hanger) -> str:
    """Why a place cannot be on a hanger; empty where it can, or is not known."""
    if x_m < 0 or x_m > (1 + _ROUNDED) * hanger.length_m:
        return (
            f"it is said to be at {x_m:g} m from the deck end, and the hanger is "
            f"{hanger.length_m:g} m long"
        )
    return ""


def refuse_off_the_hanger(
    records: Sequence[Recording | FrequencyResponse], hanger: Hanger | None
) -> None:
    """Raises BadInput naming the channel that cannot be where it is said to be."""
    if hanger is None or not hanger.as_hanger:
        return
    for record in records:
        points = record.channels if isinstance(record, Recording) else record.points
        for each in points:
            if fault := fault_of_place(each.x_m, hanger):
                raise BadInput(
                    f"{fault}.",
                    file=record.source,
                    channel=each.name,
                    remedy="Correct its x_m, in metres from the deck end, or the hanger's length.",
                )
