"""Where effects may act: ends, planes, any place along the hanger."""

from __future__ import annotations

from collections.abc import Sequence

from shm.models.effects.base import Parameter, Survey, Variant
from shm.models.hanger.physical import Zone
from shm.values import NAN, PLANES, FloatArray, Hanger

_ENDS = (("deck end", (0,)), ("arch end", (1,)), ("both ends", (0, 1)))


def single_planes(survey: Survey) -> tuple[Variant, ...]:
    """The whole hanger in each measured plane alone."""
    return tuple(
        Variant(f"everywhere, {plane}", planes=(PLANES.index(plane),)) for plane in survey.planes
    )


def planes(survey: Survey) -> tuple[Variant, ...]:
    """The whole hanger: both planes where both were measured, and each measured plane alone."""
    both = (Variant(),) if len(survey.planes) == len(PLANES) else ()
    return both + single_planes(survey)


def ends() -> tuple[Variant, ...]:
    """Each end and both, both planes alike."""
    return tuple(Variant(at, ends=where) for at, where in _ENDS)


def ends_and_planes(survey: Survey) -> tuple[Variant, ...]:
    """Each end and both; of the planes those that `planes` lists."""
    return tuple(
        Variant(plane.at.replace("everywhere", at), ends=where, planes=plane.planes)
        for at, where in _ENDS
        for plane in planes(survey)
    )


def springs(survey: Survey) -> tuple[Variant, ...]:
    """Of springs at the ends: those of `ends_and_planes`, and alike in both measured planes.

    What holds an end round its axis gives way the same in all directions; two free springs would
    pay for a freedom that it does not have.
    """
    both = len(survey.planes) == len(PLANES)
    alike = tuple(
        Variant(f"{at}, both planes alike", ends=where, alike=True) for at, where in _ENDS if both
    )
    return ends_and_planes(survey) + alike


def at_ends(variants: tuple[Variant, ...], ends: tuple[int, ...]) -> tuple[Variant, ...]:
    """Those of `variants` that act at no other ends."""
    return tuple(each for each in variants if set(each.ends) <= set(ends))


def free_planes(variant: Variant) -> tuple[int, ...]:
    """The planes that have a spring of their own; the first stands for all where they are alike."""
    return variant.planes[:1] if variant.alike else variant.planes


def place_along(hanger: Hanger) -> Parameter:
    """The place of a local effect."""
    return Parameter(
        "x_m",
        "m",
        0.0,
        hanger.length_m,
        NAN,
        "Nobody knows where along the hanger: every place is as likely.",
        least=0.0,
        most=hanger.length_m,
    )


def nested_zones(
    middle_m: FloatArray,
    extent_m: FloatArray,
    reaches: Sequence[float],
    stiffness_factor: FloatArray,
    mass_factor: FloatArray,
) -> tuple[Zone, ...]:
    """A stretch that begins and ends in steps: one zone a share of its extent, about one middle.

    Arrays (draws,); where zones overlap their factors multiply.
    """
    return tuple(
        Zone(
            start_m=middle_m - reach * extent_m / 2,
            end_m=middle_m + reach * extent_m / 2,
            stiffness_factor=stiffness_factor,
            mass_factor=mass_factor,
        )
        for reach in reaches
    )
