"""Measurement campaigns in the time domain: what the crew brings home from each test.

Equal planes ring at equal frequencies, which no single hit tells apart. So every plane is hit by
itself, along its axis, as crews do: a test has one recording a plane, all hits of it in one file.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.errors import UsageError
from shm.simulate import PlantedEffect
from shm.simulate.state import HammerPlan, HangerState
from shm.values import NAN, PLANES, Channel, FloatArray, Hanger, ModalTest, Plane, Recording
from tests.worlds.simulated.bar.description import Bar
from tests.worlds.simulated.campaign import CampaignPlan, CampaignTruth, bar_in_test, realised
from tests.worlds.simulated.elements import natural_frequencies
from tests.worlds.simulated.hammer import struck
from tests.worlds.simulated.reality import SensorError

_PASSED = 0.4
"""Of the sampling rate: the highest frequency that the logger passes."""
_PULSE_SAMPLES = 2.5
"""Of a half sine whose spectrum is still a third at the highest frequency passed."""
_PEAK_PASSED = 0.9914
"""Of such a pulse's peak."""
_SAME_PLACE_M = 1e-6  # rounding of one number that went two ways
_ALONE = 2
"""Of the usual places, the one that moves well in the first mode, too."""
_FORCE_SCATTER = 0.02
_BEFORE, _SCATTER = 0.04, 0.01
"""Of a hit's slot: when the hammer falls, and by how much later it may."""


@dataclass(frozen=True)
class Recorder:
    """How hits are recorded.

    A level of 1 is a recorded peak of `reference_force_n`. Each plane gets `hits` hits of
    `samples_a_hit` samples each, whatever the hanger. Noise is white, as standard deviations.
    """

    hits: int = 5
    samples_a_hit: int = 2560
    reference_force_n: float = 1000.0
    acceleration_noise_m_s2: float = 0.01
    force_noise_n: float = 0.5

    def sampling_rate_hz(self, hanger: Hanger, state: HangerState, modes: int) -> float:
        """A whole number: what the logger passes ends midway between two modes as described."""
        described = replace(state, tension_n=hanger.nominal_tension_n or state.tension_n)
        last, beyond = natural_frequencies(hanger, described, modes + 1).max(axis=0)[-2:]
        return float(math.ceil(math.sqrt(last * beyond) / _PASSED))


@dataclass(frozen=True, eq=False)
class RecordedTest:
    """One test of a plan: a recording for each plane that was hit."""

    id: str
    recordings: tuple[Recording, ...]


@dataclass(frozen=True, eq=False)
class RecordedCampaign:
    """The tests as recorded, and their truth."""

    tests: tuple[RecordedTest, ...]
    truth: CampaignTruth

    @property
    def recordings(self) -> tuple[Recording, ...]:
        """Those of all tests."""
        return tuple(record for test in self.tests for record in test.recordings)


def recorded(
    hanger: Hanger,
    state: HangerState,
    effects: Sequence[PlantedEffect],
    plan: CampaignPlan,
    recorder: Recorder,
    rng: np.random.Generator,
) -> RecordedCampaign:
    """The campaign that `campaign_with_truth` makes of the same generator state, as recordings.

    What a mode's frequency differs by from test to test, a fraction with the plan's
    `frequency_sd`, is planted in each test. Without shapes one sensor is recorded, the plan's third
    or its last, and the recordings do not say where. Raises UsageError for an effect or plan that
    cannot be, or that would leave planes without a common sensor.
    """
    if len(plan.planes) > 1 and not plan.biaxial:
        raise UsageError(
            "two planes hit one after the other share no sensor that is not biaxial.",
            remedy="Take biaxial sensors, or one plane.",
        )
    truth = realised(hanger, state, effects, plan, rng)
    (noise,) = rng.spawn(1)
    crew = _Crew(hanger, replace(state, tension_n=truth.tension_n), plan, recorder, truth.sensors)
    tests = tuple(
        crew.recorded(test, bar_in_test(hanger, state, truth, plan, test), noise)
        for test in plan.tests(hanger)
    )
    return RecordedCampaign(tests, truth)


@dataclass(frozen=True)
class _Crew:
    """Who hits this hanger by this plan, and records it; `state` is the true one."""

    hanger: Hanger
    state: HangerState
    plan: CampaignPlan
    recorder: Recorder
    errors: tuple[SensorError, ...]

    @property
    def sensors(self) -> tuple[SensorError, ...]:
        """Those that are recorded."""
        errors = self.errors or tuple(map(SensorError, self.plan.places_m(self.hanger)))
        return errors if self.plan.shapes else errors[: _ALONE + 1][-1:]

    def recorded(self, test: ModalTest, bar: Bar, rng: np.random.Generator) -> RecordedTest:
        """One test of a bar in which everything is planted."""
        shifts = self.plan.frequency_sd * rng.standard_normal((len(PLANES), self.plan.modes))
        seen = replace(bar, turned_rad=tuple(map(self._truly_at, bar.turned_rad)))
        records = []
        for plane in self.plan.planes:
            made = struck(
                self.hanger, self.state, self._hits(test, plane), rng, seen, shifts=shifts
            )
            records.append(self._told(made.recording, test, plane))
        return RecordedTest(test.id, tuple(records))

    def _truly_at(self, turned: tuple[float, float]) -> tuple[float, float]:
        """The place where the sensor said to be at a place really is, and its angle."""
        said, angle = turned
        off = next((e.off_m for e in self.sensors if abs(e.x_m - said) < _SAME_PLACE_M), 0.0)
        return said + off, angle

    def _hits(self, test: ModalTest, plane: Plane) -> HammerPlan:
        recorder = self.recorder
        rate = recorder.sampling_rate_hz(self.hanger, self.state, self.plan.modes)
        seconds = recorder.samples_a_hit / rate
        level = 1.0 if math.isnan(test.amplitude) else test.amplitude
        return HammerPlan(
            hits=recorder.hits,
            seconds_per_hit=seconds,
            sampling_rate_hz=rate,
            sensors_x_m=tuple(each.x_m + each.off_m for each in self.sensors),
            hammer_angle_deg=90.0 * PLANES.index(plane),
            peak_force_n=level * recorder.reference_force_n / _PEAK_PASSED,
            peak_force_scatter=_FORCE_SCATTER,
            pulse_seconds=_PULSE_SAMPLES / rate,
            pre_trigger_s=_BEFORE * seconds,
            hit_time_scatter_s=_SCATTER * seconds,
            acceleration_noise_m_s2=recorder.acceleration_noise_m_s2,
            force_noise_n=recorder.force_noise_n,
        )

    def _told(self, recording: Recording, test: ModalTest, plane: Plane) -> Recording:
        """The recording with all that its file says, and nothing else."""
        force, *accelerations = recording.channels
        channels = [replace(force, values=_single(force.values), plane=plane)]
        for index, channel in enumerate(accelerations):
            if self.plan.biaxial or channel.plane == plane:
                channels.append(self._channel(channel, self.sensors[index // len(PLANES)]))
        return Recording(
            source=f"{test.id} {plane}",
            channels=tuple(channels),
            sampling_rate_hz=float(round(recording.sampling_rate_hz)),
            hanger=self.hanger.id,
            temperature_c=test.temperature_c,
            added_mass=test.added_mass,
        )

    def _channel(self, channel: Channel, sensor: SensorError) -> Channel:
        """What a sensor reports, and where it is said to be; nothing where shapes do not count."""
        gain = sensor.gain[PLANES.index(channel.plane or PLANES[0])]
        said = sensor.x_m if self.plan.shapes else NAN
        return replace(channel, values=_single(gain * channel.values), x_m=said)


def _single(values: FloatArray) -> FloatArray:
    """As numbers of single precision hold them."""
    return np.asarray(values.astype(np.float32), np.float64)
