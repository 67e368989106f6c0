"""Each check is good on a sound record and not good where its fault is planted."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shm.errors import NotIdentifiable
from shm.identify.contract import Finding, FoundMode, Measurement
from shm.identify.measuring.setups import measure_recordings
from shm.identify.measuring.signal_faults import KNOCK
from shm.identify.quality import CHECKS, Inspection, assess, refusal, tones
from shm.values import (
    BoolArray,
    Channel,
    FloatArray,
    FrequencyResponse,
    Plane,
    Recording,
    ResponsePoint,
)
from tests.identify.planted import (
    FIRST,
    OPTIONS,
    SLOT,
    SOUND,
    changed,
    check_of,
    inspection,
    none_found,
    tone,
)
from tests.identify.signals import (
    Planted,
    Sensor,
    as_recording,
    force_signal,
    half_sine,
    hanger_modes,
    recording,
    response,
)

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "identification.md").read_text("utf-8")


@pytest.mark.parametrize("name", [row.name for row in CHECKS])
def test_page_of_identification_has_check(name: str) -> None:
    assert f"\n| {name} | " in PAGE, "Add a row to the table under Quality."


def test_a_sound_test_has_nothing_to_remark() -> None:
    figures = assess(inspection(SOUND))
    # Unstated units, a second identifier, two places, a single hit, two of records without hits.
    unasked = 6
    assert [figure.verdict for figure in figures] == (len(CHECKS) - unasked) * ["good"]
    assert all(not figure.remedy for figure in figures)
    assert refusal(figures, "test.csv") is None


def _added(name: str, first: int, more: FloatArray) -> Recording:
    return changed(name, lambda v: np.add(v[first:][: len(more)], more, out=v[first:][: len(more)]))


def _clipped(name: str, limit: float) -> Recording:
    return changed(name, lambda v: np.clip(v, -limit, limit, out=v))


def _kept(stored: slice | BoolArray) -> Recording:
    """Return the record with some of the samples of all channels."""
    return replace(
        SOUND, channels=tuple(replace(c, values=c.values[stored]) for c in SOUND.channels)
    )


def _without_unit() -> Recording:
    force, *others = SOUND.channels
    return replace(SOUND, channels=(replace(force, states_unit=False), *others))


def _saturated_twice() -> Recording:
    """Return two hits of one peak: a pulse of few samples may reach the limit only once."""

    def saturate(force: FloatArray) -> None:
        for hit in (slice(SLOT), slice(SLOT, 2 * SLOT)):
            force[hit][np.argmax(force[hit])] = 3000.0

    return changed("force", saturate)


def _without_seven_samples() -> Recording:
    stored = np.ones(SOUND.samples, bool)
    stored[SLOT + FIRST + 3040 :][:7] = False
    return _kept(stored)


def _softly_hit(seconds: float) -> Recording:
    pulse = half_sine(1024.0, 400.0, seconds)
    force = np.zeros(5 * SLOT)
    for hit in range(5):
        force[hit * SLOT + FIRST : hit * SLOT + FIRST + len(pulse)] = pulse
    rng = np.random.default_rng(0)
    accelerations = response(hanger_modes(20.0), force, 1024.0)
    noise = 0.001 * rng.standard_normal(accelerations.shape)
    return as_recording(
        force + 0.2 * rng.standard_normal(len(force)), accelerations + noise, 1024.0
    )


def _one_hit_of_another_direction() -> Recording:
    rng = np.random.default_rng(0)
    force = force_signal([hit * SLOT + FIRST for hit in range(5)], 5 * SLOT, 1024.0, 5 * [2000.0])
    odd = np.zeros_like(force)
    odd[2 * SLOT : 3 * SLOT] = force[2 * SLOT : 3 * SLOT]
    straight = hanger_modes(20.0)
    turned = [replace(mode, drive=mode.drive * (-1) ** n) for n, mode in enumerate(straight)]
    total = response(straight, force - odd, 1024.0) + response(turned, odd, 1024.0)
    total += 0.02 * rng.standard_normal(total.shape)
    return as_recording(force, total, 1024.0)


LOUDEST = float(np.abs(SOUND.channels[1].values).max())
BLOW = half_sine(1024.0, 500.0)
CRACKLE = 20 * np.random.default_rng(0).standard_normal(50)
PLANTED: tuple[tuple[str, Callable[[], Recording], float | None, str], ...] = (
    ("units", _without_unit, None, "unit of force: N"),
    ("double hits", lambda: _added("force", SLOT + FIRST + 60, BLOW), 1, "8.5 s"),
    ("repeatability", _without_seven_samples, None, "samples are lost: the hit at 8"),
    ("repeatability", _one_hit_of_another_direction, None, "16.5 s"),
    ("clipping", lambda: _clipped("acc_1", 0.3 * LOUDEST), None, "acc_1"),
    ("clipping", lambda: _clipped("force", 1000.0), 5, "force is clipped"),
    ("clipping", _saturated_twice, 2, ""),
    ("cable", lambda: _added("acc_2", SLOT + 3000, CRACKLE), 1, ""),
    ("drop-outs", lambda: _added("acc_2", SLOT + 3000, np.array([np.nan])), 1, ""),
    ("pre-trigger", lambda: _kept(slice(FIRST + 1, None)), 0, ""),
    ("ring-down", lambda: _kept(slice(4 * SLOT + 1200)), None, "cut off"),
    ("force spectrum", lambda: _softly_hit(0.04), None, "reaches 3[34] Hz"),
)  # fmt: skip
"""Check, record, figure and what is said. A half sine of 40 ms is first zero at 1.5 / 0.04 = 37.5
Hz, a tenth of its largest before. Hits of one peak force to the last bit are clipped."""


@pytest.mark.parametrize(("name", "make", "value", "said"), PLANTED)
def test_a_planted_fault_is_told(
    name: str, make: Callable[[], Recording], value: float | None, said: str
) -> None:
    found = check_of(name, make())
    assert found.verdict == "warning"
    assert value is None or found.value == value
    assert re.search(said, found.found)


@pytest.mark.parametrize("row", [5, 9, 11])
def test_hits_of_which_only_the_force_is_spoilt_are_used(row: int) -> None:
    assert check_of("hits", PLANTED[row][1]()).value == 5


def test_figures_of_a_sound_test() -> None:
    assert check_of("pre-trigger").value == pytest.approx(500.0, abs=2)
    assert check_of("force spectrum").value > -3
    assert check_of("repeatability").value < 0.01


@pytest.mark.parametrize("heard", [("transverse",), ("transverse", "longitudinal")])
def test_a_hit_that_the_force_does_not_show_ends_the_ring_down_in_which_it_falls(
    heard: tuple[str, ...],
) -> None:
    """All sensors hear it in both planes, or in one: no fault of cables."""
    at, late = SLOT + FIRST, 2600
    rng = np.random.default_rng(5)

    def knock(values: FloatArray) -> None:
        values[at + late : 2 * SLOT] += 0.7 * values[at : 2 * SLOT - late].copy()

    def beside(channel: Channel) -> Channel:
        hiss = 0.02 * rng.standard_normal(len(channel.values))
        return replace(channel, name=f"{channel.name}b", values=0.8 * channel.values + hiss)

    more = tuple(beside(channel) for channel in SOUND.accelerations)
    record = replace(SOUND, channels=(*SOUND.channels, *more))
    for channel in record.accelerations:
        if channel.plane in heard:
            record = changed(channel.name, knock, record)
    (measurement,) = measure_recordings([record], OPTIONS)
    assert all(hit.used for hit in measurement.hits)
    assert [hit.cut for hit in measurement.hits if hit.cut] == [KNOCK]
    lengths = [decay.shape[1] for decay in measurement.decays]
    assert lengths[1] == pytest.approx(lengths[0] * late / (SLOT - FIRST), rel=0.2)
    assert not measurement.dropped


def test_repeatability_force_lost_before_hits() -> None:
    """What the force was before a hit is not needed: the hits agree as they do without the gap."""

    def lose(values: FloatArray) -> None:
        for hit in range(1, SOUND.samples // SLOT):
            values[hit * SLOT + FIRST - 12 : hit * SLOT + FIRST - 8] = np.nan

    found = check_of("repeatability", changed("force", lose))
    assert found.verdict == "good"
    assert found.value == pytest.approx(check_of("repeatability", SOUND).value, rel=0.01)


def test_noise_unknown_of_one_channel() -> None:
    """A channel that lost samples whenever nothing rang says nothing of the noise; others do."""

    def lose(values: FloatArray) -> None:
        values[FIRST // 2] = values[-100] = np.nan
        for hit in range(1, SOUND.samples // SLOT):
            values[hit * SLOT + FIRST - 100] = np.nan

    sound = check_of("noise", SOUND)
    found = check_of("noise", changed("acc_2", lose))
    assert found.value == pytest.approx(sound.value, abs=3.0)


def test_the_level_at_the_end_of_a_ring_down_is_told() -> None:
    """A mode of 10 Hz and 1 % falls by exp(-2 pi 0.1 t): 0.9 of 7.75 s are 38 dB."""
    modes = [Planted(10.0, 0.01, (1.0, 0.4))]
    found = check_of("ring-down", recording(modes, noise=1e-4, lead_s=0.5))
    assert found.value == pytest.approx(-38.0, abs=1.0)
    assert found.verdict == "good"


def test_a_steady_tone_is_told_and_no_mode_is() -> None:
    """0.2 m/s^2 at 41.3 Hz in both channels, where the modes ring with several."""
    added = tone(5 * SLOT, 41.3, 0.2)
    record = changed("acc_1", lambda v: np.add(v, added, out=v))
    found = tones(measure_recordings([record], OPTIONS), [record], OPTIONS)
    assert [t.frequency_hz for t in found] == pytest.approx([41.3], abs=0.02)
    assert found[0].name == "a machine"
    assert check_of("tones", record).value == 1.0


def test_mains_and_named_machines_are_named() -> None:
    added = tone(5 * SLOT, 40.02, 0.2) + tone(5 * SLOT, 45.5, 0.2)
    record = changed("acc_1", lambda v: np.add(v, added, out=v))
    options = replace(OPTIONS, mains_hz=40.0, disturbance_bands=(("pump", 45.0, 46.0),))
    found = tones(measure_recordings([record], options), [record], options)
    assert [t.name for t in found] == ["mains", "pump"]


def test_a_lightly_damped_mode_is_no_tone() -> None:
    """0.01 % at 12 Hz: it still rings at the end, but each hit gives it a new phase."""
    modes = [Planted(12.0, 1e-4, (1.0, 0.5)), Planted(31.0, 1e-4, (0.5, 1.0))]
    assert check_of("tones", recording(modes, noise=0.02, lead_s=0.6)).verdict == "good"


def test_a_ring_down_before_the_first_hit_makes_no_tone() -> None:
    """The record begins in one, and hits are 8 s apart: lines of 1/8 Hz keep their phase."""
    modes = [
        Planted(25.2, 0.003, (1.0,)),
        Planted(29.5, 0.002, (0.5,)),
        Planted(34.0, 0.003, (1.0,)),
    ]
    tapped = recording(modes, (Sensor(),), noise=0.001, lead_s=0.0, seed=5)
    record = replace(tapped, channels=tapped.channels[1:])
    assert tones(measure_recordings([record], OPTIONS), [record], OPTIONS) == ()


@pytest.mark.parametrize(
    ("plane", "verdict"), [("longitudinal", "good"), ("transverse", "warning")]
)
def test_an_axis_across_the_motion_is_no_cable_fault(plane: Plane, verdict: str) -> None:
    modes = [Planted(6.0, 0.002, (1.0, 0.0)), Planted(13.5, 0.003, (0.8, 0.0))]
    sensors = (Sensor("transverse", 2.0), Sensor(plane, 2.0))
    assert check_of("cable", recording(modes, sensors, noise=1e-3)).verdict == verdict


def test_a_weak_tone_between_short_ring_downs_is_told() -> None:
    """Halves of ring-downs of 3 s smear it over 3 Hz; it has 1/50 of the signal's rms, as noise."""
    modes = [Planted(20.0, 0.002, (1.0, 0.5)), Planted(31.0, 0.002, (0.5, 1.0))]
    sound = recording(modes, seconds=3.0, noise=20.0, lead_s=0.6)
    assert check_of("tones", sound).verdict == "good"
    added = tone(len(sound.channels[0].values), 25.3, 20.0)
    humming = changed("acc_1", lambda v: np.add(v, added, out=v), sound)
    found = tones(measure_recordings([humming], OPTIONS), [humming], OPTIONS)
    assert [t.frequency_hz for t in found] == pytest.approx([25.3], abs=0.02)


@pytest.mark.parametrize("hits", [3, 5])
def test_without_time_before_the_first_hit_only_what_ignores_the_hits_is_a_tone(hits: int) -> None:
    modes = [Planted(12.0, 1e-4, (1.0, 0.5)), Planted(31.0, 1e-4, (0.5, 1.0))]
    ringing = recording(modes, hits=hits, noise=0.002, lead_s=0.6)
    late = replace(
        ringing, channels=tuple(replace(c, values=c.values[600:]) for c in ringing.channels)
    )
    assert check_of("tones", late).verdict == "good"
    added = tone(len(late.channels[0].values), 40.07, 0.05)
    humming = changed("acc_1", lambda v: np.add(v, added, out=v), late)
    assert check_of("tones", humming).value == 1.0


def test_sensors_that_feel_nothing_of_the_hits_are_refused() -> None:
    rng = np.random.default_rng(3)
    record = as_recording(SOUND.channels[0].values, rng.standard_normal((2, 5 * SLOT)), 1024.0)
    found = check_of("noise", record)
    assert found.verdict == "refused"
    error = refusal([found], "test.csv")
    assert isinstance(error, NotIdentifiable)
    assert error.remedy
    assert "noise" in error.message


def test_the_signal_to_noise_ratio_is_about_what_was_planted() -> None:
    """One mode at 20 Hz of 0.2 %, amplitude a: a^2 / 2 over the noise between 2 and 50 Hz."""
    quiet = recording([Planted(20.0, 0.002, (1.0, 0.5))], noise=0.0, lead_s=0.5)
    after = np.std(quiet.channels[1].values[FIRST + 20 : FIRST + 400])
    noisy = recording([Planted(20.0, 0.002, (1.0, 0.5))], noise=0.05 * float(after), lead_s=0.5)
    expected = 20 * np.log10(1 / 0.05) + 10 * np.log10(512 / 48)
    assert check_of("noise", noisy).value == pytest.approx(expected, abs=3.0)


def test_a_single_hit_that_begins_with_its_record_is_refused() -> None:
    record = recording(hanger_modes(20.0), hits=1, noise=0.02, lead_s=0.0)
    assert check_of("hits", record).verdict == "refused"
    assert check_of("hits", recording(hanger_modes(), hits=1, noise=0.02)).verdict == "warning"


def _responses(coherence: float | None) -> Inspection:
    frequency = np.arange(201) * 0.25
    size = 1 / (1 + (frequency - 20.0) ** 2)
    given = None if coherence is None else np.full((1, 201), coherence)
    measured = FrequencyResponse(
        "r.unv", (ResponsePoint("p"),), frequency, size[np.newaxis].astype(complex), given
    )
    return Inspection(
        [], [Measurement("r.unv", measured.points, (np.ones((1, 64)),), 100.0, measured)], OPTIONS
    )


@pytest.mark.parametrize(
    ("coherence", "verdict"), [(0.99, "good"), (0.7, "warning"), (0.31, "refused")]
)
def test_measured_responses_are_judged_by_their_coherence(coherence: float, verdict: str) -> None:
    (found,) = assess(_responses(coherence))
    assert (found.name, found.verdict) == ("coherence", verdict)
    assert found.value == pytest.approx(coherence)


def _finding(*frequencies_hz: float) -> Finding:
    return none_found(
        *(FoundMode(f, 0.0, 0.001, 0.0, np.ones(2), np.zeros(2)) for f in frequencies_hz)
    )


def test_two_identifiers_are_compared_mode_by_mode() -> None:
    sound = inspection(SOUND)
    both = replace(sound, finding=_finding(6.0, 13.5), cross_check=_finding(6.006, 13.5, 40.0))
    (found,) = [figure for figure in assess(both) if figure.name == "cross-check"]
    assert found.value == pytest.approx(1e-3)
    assert found.verdict == "good"
    assert "40.00 Hz" in found.found
    apart = replace(both, cross_check=_finding(6.03))
    (found,) = [figure for figure in assess(apart) if figure.name == "cross-check"]
    assert (found.verdict, found.value) == ("warning", pytest.approx(5e-3))
    assert "13.50 Hz" in found.found
