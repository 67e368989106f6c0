"""The same samples are known again whatever the file around them says; another impact is not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest

from shm.plausibility import fingerprint_of
from shm.plausibility.copies import is_copy
from shm.simulate import HammerPlan, HangerState, hammer_test
from shm.values import Channel, FrequencyResponse, Recording, ResponsePoint
from tests.helpers.hangers import HANGER_3
from tests.helpers.workspaces import START

STATE = HangerState(711e3, 1e7, 1e6, 1e7, 1e8)


def a_recording(seed: int = 1, hits: int = 3) -> Recording:
    plan = HammerPlan(hits=hits)
    return hammer_test(HANGER_3, STATE, plan, np.random.default_rng(seed), time=START, source="s")


def changed(recording: Recording, change: Callable[[Channel], Channel]) -> Recording:
    return replace(recording, channels=tuple(change(each) for each in recording.channels))


def rounded(channel: Channel, digits: int) -> Channel:
    numbers = [float(f"{value:.{digits - 1}e}") for value in channel.values]
    return replace(channel, values=np.array(numbers))


def cut(channel: Channel, samples: int) -> Channel:
    return replace(channel, values=channel.values[samples:-samples])


COPIES: dict[str, Callable[[Recording], Recording]] = {
    "another header": lambda r: replace(r, source="x", hanger=4, time=START + timedelta(days=9)),
    "other order": lambda r: replace(r, channels=r.channels[::-1]),
    "other unit": lambda r: changed(r, lambda c: replace(c, values=c.values / 9.80665)),
    "turned sensor": lambda r: changed(r, lambda c: replace(c, values=-c.values)),
    "an offset": lambda r: changed(r, lambda c: replace(c, values=c.values + 0.01)),
    "four digits": lambda r: changed(r, lambda c: rounded(c, 4)),
    "single precision": lambda r: changed(
        r, lambda c: replace(c, values=c.values.astype("f4").astype(float))
    ),
    "cut": lambda r: changed(r, lambda c: cut(c, 7)),
    "one sensor left out": lambda r: replace(r, channels=r.channels[:-1]),
    "all at once": lambda r: changed(
        replace(r, channels=r.channels[::-1]),
        lambda c: cut(rounded(replace(c, values=c.values * 1000), 5), 3),
    ),
}


@pytest.mark.parametrize("hits", [1, 3])
@pytest.mark.parametrize("how", COPIES)
def test_a_copy_is_known(how: str, hits: int) -> None:
    original = a_recording(hits=hits)
    own, copy = fingerprint_of([original]), fingerprint_of([COPIES[how](original)])
    assert own is not None
    assert copy is not None
    assert is_copy(copy, own)
    assert is_copy(own, copy)


@pytest.mark.parametrize("hits", [1, 3])
def test_other_impacts_on_the_same_hanger_are_no_copies(hits: int) -> None:
    prints = [fingerprint_of([a_recording(seed, hits)]) for seed in range(8)]
    pairs = [(a, b) for i, a in enumerate(prints) for b in prints[:i] if a and b]
    assert len(pairs) == 28
    assert not any(is_copy(*pair) for pair in pairs)


def test_the_digest_is_that_of_the_numbers_alone() -> None:
    one = a_recording()
    digests = {
        found.digest
        for how in ("another header", "other order")
        if (found := fingerprint_of([COPIES[how](one)]))
    }
    own, other = fingerprint_of([one]), fingerprint_of([a_recording(2)])
    assert own is not None
    assert other is not None
    assert digests == {own.digest}
    assert other.digest != own.digest


def test_one_file_of_a_test_of_several_is_a_copy() -> None:
    """Its impact would count twice."""
    parts = [a_recording(seed) for seed in (1, 2, 3)]
    whole, part = fingerprint_of(parts), fingerprint_of([parts[1]])
    assert whole is not None
    assert part is not None
    assert is_copy(part, whole)


def test_a_dead_channel_that_hums_alike_condemns_nothing() -> None:
    hum = np.sin(2 * np.pi * 50 * np.arange(5120) / 512)
    first, second = (
        replace(r, channels=(*r.channels, Channel("dead", "acceleration", hum)))
        for r in (a_recording(1), a_recording(2))
    )
    own, other = fingerprint_of([first]), fingerprint_of([second])
    assert own is not None
    assert other is not None
    assert not is_copy(own, other)


def test_frequency_responses_are_compared_too() -> None:
    rng = np.random.default_rng(1)
    lines = rng.normal(size=(2, 400)) + 1j * rng.normal(size=(2, 400))
    points = (ResponsePoint("a"), ResponsePoint("b"))
    response = FrequencyResponse("a.uff", points, np.arange(400.0), lines)
    scaled = replace(response, source="b.uff", accelerance=lines * 2)
    another = replace(response, accelerance=lines + 0.01 * rng.normal(size=(2, 400)))
    own, copy, other = (fingerprint_of([each]) for each in (response, scaled, another))
    assert own is not None
    assert copy is not None
    assert other is not None
    assert is_copy(own, copy)
    assert not is_copy(own, other)


@pytest.mark.parametrize("values", [np.zeros(100), np.full(100, np.nan), np.empty(0)])
def test_what_does_not_move_has_no_fingerprint(values: np.ndarray) -> None:
    dead = Recording("s", (Channel("a", "acceleration", values),), 512.0)
    assert fingerprint_of([dead]) is None
