"""Devices that samples come from: an audio interface, and a simulated one that plays hits."""

from __future__ import annotations

import queue
from typing import Any, Protocol

import numpy as np

from shm.errors import BadInput
from shm.simulate import HammerPlan, HangerState, hammer_test
from shm.values import Channel, FloatArray, Hanger


class DeviceLost(BadInput):
    """The device gives no more samples; what it gave before is good."""


class Device(Protocol):
    """A source of samples at a fixed rate."""

    sampling_rate_hz: float

    def read(self, samples: int) -> FloatArray:
        """Return the next samples (channels, samples) in parts of full scale, NaN where lost.

        Raises DeviceLost where the device has gone.
        """
        ...

    def close(self) -> None: ...


class SoundCard:
    """The first channels of an audio interface, by PortAudio.

    Samples are queued while nobody reads; with none for `patience_s` the interface has gone.
    """

    def __init__(self, name: str, channels: int, patience_s: float = 2.0):
        try:
            import sounddevice  # an extra, which loads a library of the machine
        except (ImportError, OSError) as error:
            raise BadInput(
                f"no audio interface can be opened: {error}.",
                remedy="Install `shm[audio]`, and PortAudio (Debian: libportaudio2). To try the "
                "command without an interface: --device simulated.",
            ) from error
        self._queue: queue.SimpleQueue[FloatArray] = queue.SimpleQueue()
        self._unread, self._patience_s = np.empty((channels, 0)), patience_s
        try:
            self._stream = sounddevice.InputStream(
                device=int(name) if name.isdecimal() else name,
                channels=channels,
                callback=self._receive,
            )
            self._stream.start()
        except (sounddevice.PortAudioError, ValueError) as error:
            inputs = [str(each["name"]) for each in sounddevice.query_devices()
                      if each["max_input_channels"] >= channels]  # fmt: skip
            raise BadInput(
                f"device {name} gives no {channels} channels: {error}.",
                remedy=f"Devices that do: {'; '.join(inputs) or 'none is connected'}.",
            ) from error
        self.sampling_rate_hz = float(self._stream.samplerate)

    def _receive(self, data: FloatArray, frames: int, time: Any, status: Any) -> None:
        block = np.array(data.T, np.float64)
        if status.input_overflow:
            block[:, 0] = np.nan
        self._queue.put(block)

    def read(self, samples: int) -> FloatArray:
        while self._unread.shape[1] < samples:
            try:
                block = self._queue.get(timeout=self._patience_s)
            except queue.Empty:
                raise DeviceLost(
                    f"the audio interface has gone: no sample for {self._patience_s:g} s.",
                    remedy="Check its cable and its supply.",
                ) from None
            self._unread = np.concatenate([self._unread, block], axis=1)
        block, self._unread = self._unread[:, :samples], self._unread[:, samples:]
        return block

    def close(self) -> None:
        self._stream.close(ignore_errors=True)


class SimulatedDevice:
    """A device that plays hits on a simulated hanger, one each `seconds`, as fast as it is read.

    Of the hits, counted from 1, those of `double` strike twice, those of `overload` are beyond full
    scale; after `lost_s` seconds it vanishes. Its tension is the nominal one.
    """

    def __init__(
        self,
        hanger: Hanger,
        channels: tuple[Channel, ...],
        rng: np.random.Generator,
        *,
        hits: int = 8,
        seconds: float = 25.0,
        double: tuple[int, ...] = (),
        overload: tuple[int, ...] = (),
        lost_s: float = np.inf,
        sampling_rate_hz: float = 2000.0,
    ):
        self.sampling_rate_hz, self._at, self._lost_s = sampling_rate_hz, 0, lost_s
        force, *sensors = channels
        plan = HammerPlan(
            hits=hits,
            seconds_per_hit=seconds,
            sampling_rate_hz=sampling_rate_hz,
            sensors_x_m=tuple(dict.fromkeys(each.x_m for each in sensors)),
            hammer_x_m=force.x_m,
            hammer_angle_deg={"transverse": 0.0, "longitudinal": 90.0}.get(force.plane or "", 45.0),
            pre_trigger_s=4.0,
            acceleration_noise_m_s2=0.02,
            adc_bits=32,
            force_range_n=100 * force.full_scale,
            acceleration_range_m_s2=100 * max(each.full_scale for each in sensors),
        )
        made = hammer_test(hanger, HangerState(hanger.nominal_tension_n), plan, rng)
        by_place = {(each.plane, each.x_m): each.values for each in made.accelerations}
        assert made.force is not None
        played = np.array([made.force.values, *(by_place[e.plane, e.x_m] for e in sensors)])
        played /= np.array([[each.full_scale] for each in channels])
        for hit, part in enumerate(np.split(played, hits, axis=1), start=1):
            if hit in double:  # the bar is linear: a second blow adds its own response
                later = round(0.08 * sampling_rate_hz)
                part[:, later:] += 0.5 * part[:, :-later].copy()
            if hit in overload:
                part *= 1.5 / np.abs(part).max()
        self._played = np.asarray(np.clip(played, -1.0, 1.0), np.float64)

    def read(self, samples: int) -> FloatArray:
        begin, self._at = self._at, self._at + samples
        if self._at > min(self._played.shape[1], self._lost_s * self.sampling_rate_hz):
            raise DeviceLost("the simulated device has gone.", remedy="It plays so long only.")
        return self._played[:, begin : self._at]

    def close(self) -> None:
        """Close nothing."""
