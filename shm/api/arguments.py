"""Refuse arguments of another type or size, by their names, before anything is computed."""

from __future__ import annotations

from collections.abc import Sequence

from shm.errors import UsageError
from shm.identify import Identification
from shm.values import FrequencyResponse, Hanger, ModalTest, Recording


def check_hanger(hanger: object) -> None:
    """Raise UsageError if `hanger` is no description of a hanger."""
    if not isinstance(hanger, Hanger):
        raise UsageError(
            f"hanger is {hanger!r}, not a Hanger.",
            remedy='Give hanger=shm.load_hanger("bridge.toml", 3), or shm.round_bar(...).',
        )


def check_records(records: Sequence[object]) -> None:
    """Raise UsageError if one of `records` was not read, or there is none."""
    if not records:
        raise UsageError("no record to identify modes in.", remedy="Give at least one.")
    for each in records:
        if not isinstance(each, Recording | FrequencyResponse):
            raise UsageError(
                f"records holds {each!r}, not a recording.",
                remedy="Read the file first: shm.identify(shm.read(path)).",
            )


def check_tests(name: str, tests: Sequence[object]) -> None:
    """Raise UsageError if one of `tests` has no modes as a modal test has them."""
    for each in tests:
        if not isinstance(each, ModalTest | Identification):
            raise UsageError(
                f"{name} holds {each!r}, not a modal test.",
                remedy=f"Give {name}=shm.load_modes(path), or shm.identify(shm.read(path)).",
            )


def check_names(name: str, given: object, example: str) -> None:
    """Raise UsageError if a list of names is a single text, whose letters would be its names."""
    if isinstance(given, str):
        raise UsageError(
            f"{name} is the text {given!r}, not a list of names.",
            remedy=f"Write {name}=[{given or example!r}].",
        )
