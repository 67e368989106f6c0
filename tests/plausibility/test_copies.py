"""The same samples are known again whatever the file around them says; another impact is not."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from datetime import timedelta
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from shm.plausibility import Candidate, fingerprint_of
from shm.plausibility.copies import copied, shared
from shm.simulate import HammerPlan, HangerState, hammer_test
from shm.values import (
    Channel,
    Fingerprint,
    KnownSamples,
    Recording,
)
from tests.helpers.hangers import HANGER_3
from tests.helpers.workspaces import START, modelled_test

PLAIN = Candidate(
    HANGER_3, modelled_test("t", HANGER_3), START + timedelta(days=1), timedelta(days=1)
)
STATE = HangerState(711e3, 1e7, 1e6, 1e7, 1e8)


@cache
def a_recording(seed: int = 1, hits: int = 3, noise_m_s2: float = 0.002) -> Recording:
    plan = HammerPlan(hits=hits, acceleration_noise_m_s2=noise_m_s2)
    return hammer_test(HANGER_3, STATE, plan, np.random.default_rng(seed), time=START, source="s")


@cache
def print_of(seed: int = 1, hits: int = 3, noise_m_s2: float = 0.002) -> Fingerprint:
    found = fingerprint_of([a_recording(seed, hits, noise_m_s2)])
    assert found is not None
    return found


def changed(recording: Recording, change: Callable[[Channel], Channel]) -> Recording:
    return replace(recording, channels=tuple(change(each) for each in recording.channels))


def duration_s(recording: Recording) -> float:
    return len(recording.channels[0].values) / recording.sampling_rate_hz


def rounded(channel: Channel, digits: int) -> Channel:
    numbers = [float(f"{value:.{digits - 1}e}") for value in channel.values]
    return replace(channel, values=np.array(numbers))


def cut(channel: Channel, samples: int) -> Channel:
    return replace(channel, values=channel.values[samples:-samples])


def part(recording: Recording, start_s: float, end_s: float) -> Recording:
    """Return the recording between two times; a negative one counts from its end."""
    first, last = (round(time * recording.sampling_rate_hz) for time in (start_s, end_s))
    return changed(recording, lambda c: replace(c, values=c.values[first:last]))


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
    "cut at both ends": lambda r: part(r, 0.6, -1.8),
    "without its onset": lambda r: part(r, 3.9, 1e9),
    "70 % of it": lambda r: part(r, 0, 0.7 * duration_s(r)),
    "other unit, rounded, cut": lambda r: part(
        changed(r, lambda c: rounded(replace(c, values=c.values / 9.80665), 4)), 1000 / 512, 1e9
    ),
    "a tenth of it, rounded": lambda r: part(
        changed(r, lambda c: rounded(c, 4)), 0.3 * duration_s(r), 0.4 * duration_s(r)
    ),
    "zeros after it": lambda r: changed(
        r, lambda c: replace(c, values=np.append(c.values, np.zeros(4000)))
    ),
    "one sensor left out": lambda r: replace(r, channels=r.channels[:-1]),
    "all at once": lambda r: changed(
        replace(r, channels=r.channels[::-1]),
        lambda c: cut(rounded(replace(c, values=c.values * 1000), 5), 3),
    ),
}


def of_hits(ways: Iterable[str], *hardest: str) -> list[object]:
    """One hit in every way; of three, whose prints take three times as long, in the hardest."""
    return [
        pytest.param(
            how, hits, marks=[pytest.mark.trial] if hits > 1 and how not in hardest else []
        )
        for how in ways
        for hits in (1, 3)
    ]


@pytest.mark.parametrize(
    ("how", "hits"),
    of_hits(COPIES, "all at once", "a tenth of it, rounded", "without its onset"),
)
def test_a_copy_is_known(how: str, hits: int) -> None:
    original = a_recording(2, hits)  # it has hit before the 0.6 s
    own, copy = print_of(2, hits), fingerprint_of([COPIES[how](original)])
    assert copy is not None
    assert shared(copy, own)
    assert shared(own, copy)


def candidate(own: Recording, *known: KnownSamples) -> Candidate:
    return replace(PLAIN, fingerprint=_print(own), copies=known)


def known(number: int, recording: Recording, counts: bool = True) -> KnownSamples:
    print_ = _print(recording)
    return KnownSamples(f"f{number} (recording {number})", 3, print_, number, counts)


def _print(recording: Recording) -> Fingerprint:
    found = print_of() if recording is a_recording() else fingerprint_of([recording])
    assert found is not None
    return found


def state_of(own: Recording, *others: KnownSamples) -> tuple[str, tuple[int, ...]]:
    doubt = copied(candidate(own, *others))
    assert doubt is not None
    return doubt.state, doubt.instead_of


def test_the_whole_of_several_parts_names_them_all() -> None:
    whole = a_recording()
    parts = [known(n, part(whole, 10 * n, 10 * n + 10)) for n in range(5)]
    state, instead_of = state_of(whole, *parts)
    assert instead_of == (0, 1, 2, 3, 4)
    assert state.count("recording ") == 3
    assert state.endswith("and of 2 more recordings")


def test_what_counts_is_named_before_what_is_held_and_what_has_most_before_the_rest() -> None:
    """A part matched an earlier copy, too, and that was named in place of the original."""
    whole = a_recording()
    half, third = part(whole, 0, 30), part(whole, 0, 20)
    copy, original = known(1, whole, counts=False), known(2, whole)
    assert "f2" in state_of(half, copy, original)[0]
    assert "f2" in state_of(half, known(1, third), original)[0]
    assert "f1" in state_of(half, copy)[0]
    assert state_of(whole, known(1, half, counts=False), known(2, third)) == (
        "it holds f2 (recording 2)",
        (2,),
    )


@pytest.mark.parametrize("noise_m_s2", [0.002, 2e-5])
@pytest.mark.parametrize("hits", [1, 3])
def test_other_impacts_on_the_same_hanger_are_no_copies(hits: int, noise_m_s2: float) -> None:
    prints = [print_of(seed, hits, noise_m_s2) for seed in range(4)]
    pairs = [(a, b) for i, a in enumerate(prints) for b in prints[:i]]
    assert len(pairs) == 6
    assert not any(shared(*pair) for pair in pairs)


@pytest.mark.parametrize(("hits", "bits"), [(1, 12), (1, 16), (1, 24), (3, 16)])
def test_hits_of_a_machine_are_no_copies(hits: int, bits: int) -> None:
    """Keep identical hits apart, which differ in their background at most."""
    plan = HammerPlan(hits=hits, adc_bits=bits, peak_force_scatter=0.0, hit_time_scatter_s=0.0)
    machine = (
        hammer_test(HANGER_3, STATE, plan, np.random.default_rng(n), time=START, source="s")
        for n in range(4)
    )
    prints = [fingerprint_of([each]) for each in machine]
    pairs = [(a, b) for i, a in enumerate(prints) for b in prints[:i] if a and b]
    assert len(pairs) == 6
    assert not any(shared(*pair) for pair in pairs)


def test_real_hits_of_one_structure_are_copies_of_their_own_halves_alone(shared_data: Path) -> None:
    paths = sorted((shared_data / "pyfrf_hits").glob("*.npy"))
    rows = [np.load(path)[2] for path in paths]
    wholes = [Recording("s", (Channel("a", "acceleration", row),), 25_600.0) for row in rows]
    halves = [part(whole, 0.3, 0.8) for whole in wholes]
    prints, cuts = ([fingerprint_of([each]) for each in some] for some in (wholes, halves))
    alike = [[bool(a and b and shared(a, b)) for b in prints] for a in cuts]
    assert len(rows) == 5
    assert alike == np.eye(5, dtype=bool).tolist()


def test_one_file_of_a_test_of_several_is_a_copy() -> None:
    """Its impact would count twice."""
    parts = [a_recording(seed) for seed in (1, 2, 3)]
    whole, part = fingerprint_of(parts), fingerprint_of([parts[1]])
    assert whole is not None
    assert part is not None
    assert shared(part, whole)
