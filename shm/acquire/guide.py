"""Guide a crew through a hammer test: each hit is checked while the hanger rings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from itertools import compress

import numpy as np

from shm.acquire.devices import Device, DeviceLost
from shm.errors import BadInput
from shm.identify import Identification, IdentifyOptions, identify
from shm.identify.measuring.hits import find_pulses
from shm.identify.quality.of_hits import HITS, REPEATABILITY
from shm.identify.quality.of_modes import COHERENCE
from shm.values import Channel, FloatArray, Hanger, Recording

_MORE_HITS_HELP = frozenset(row.name for row in (HITS, REPEATABILITY, COHERENCE))
Tell = Callable[[str], object]


@dataclass(frozen=True)
class AcquireOptions:
    """Define how hits are recorded, and when they are enough.

    `seconds` is the ring-down that is recorded of each hit, after `pre_trigger_s`; a hit begins
    where the force exceeds `trigger_share` of full scale. There are `least_hits` to `most_hits`;
    from `least_hits` on they are enough once the worst mode is known to `precision` (standard
    deviation over frequency) and no check warns that more hits would help. Levels are measured for
    `quiet_s`.
    """

    rate_hz: float = 1000.0
    seconds: float = 20.0
    pre_trigger_s: float = 0.5
    trigger_share: float = 0.01
    least_hits: int = 3
    most_hits: int = 10
    precision: float = 1e-3
    quiet_s: float = 2.0
    block_s: float = 0.1
    full_scale_share: float = 0.999


@dataclass(frozen=True)
class Acquired:
    """The hits that count, one recording each; why others do not; what they give so far.

    `lost` says why the device gave no more, empty where it did. `missing` is what is not good
    enough.
    """

    hits: tuple[Recording, ...]
    rejected: tuple[str, ...]
    found: Identification | None
    missing: str
    lost: str = ""


class _Input:
    """A device in blocks at the rate of the recording, in N and m/s^2, delayed alike."""

    def __init__(self, device: Device, channels: Sequence[Channel], options: AcquireOptions):
        from scipy.signal import firwin  # it takes longer to load than a device to open

        self._device, self._channels, self._options = device, channels, options
        self._scales = np.array([[each.full_scale] for each in channels])
        self._factor = max(1, round(device.sampling_rate_hz / options.rate_hz))
        self.rate_hz = device.sampling_rate_hz / self._factor
        taps = 64 * self._factor + 1
        self._filter = firwin(taps, 0.8 / self._factor) if self._factor > 1 else np.ones(1)
        self._before = np.zeros((len(channels), len(self._filter) - 1))

    def read(self) -> tuple[FloatArray, str]:
        """Return a block (channels, samples), and what is wrong with it; empty: nothing."""
        from scipy.signal import oaconvolve

        raw = self._device.read(self._factor * round(self._options.block_s * self.rate_hz))
        fault = (
            "Samples were lost: let this computer do nothing else." if np.isnan(raw).any() else ""
        )
        raw = np.nan_to_num(raw)
        over = np.abs(raw).max(axis=1) >= self._options.full_scale_share
        if over.any():
            names = ", ".join(each.name for each in compress(self._channels, over))
            fault = f"Overload of {names}: turn the gain down, or hit more softly."
        joined = np.concatenate([self._before, raw], axis=1)
        self._before = joined[:, joined.shape[1] - self._before.shape[1] :]
        even = oaconvolve(joined, self._filter[np.newaxis], mode="valid", axes=1)
        return self._scales * even[:, :: self._factor], fault


def acquire(
    device: Device,
    channels: Sequence[Channel],
    tell: Tell,
    options: AcquireOptions | None = None,
    *,
    hanger: Hanger | None = None,
    clock: Callable[[], datetime | None] = lambda: None,
) -> Acquired:
    """Record hits until their modes are good enough; `tell` what to do and what is wrong.

    `channels` are the hammer, then the sensors, without values; `full_scale` is what full scale
    of the device is worth in N or m/s^2. Raises BadInput where a channel is dead at the beginning.
    """
    options = options or AcquireOptions()
    source = _Input(device, channels, options)
    hits: list[Recording] = []
    rejected: list[str] = []
    found, missing, lost_by = None, "no hit yet", ""
    try:
        calm = _check_levels(source, channels, tell, options)
        while len(hits) < options.most_hits:
            tell(f"Hit {len(hits) + 1}: hit now.")
            values, fault, lost = _record_hit(source, channels, options)
            if not fault:
                hits.append(_recording(values, source.rate_hz, channels, hanger, clock()))
                peak = f"{np.abs(values[0]).max():.0f} N"
                tell(f"Hit {len(hits)} is {'cut short' if lost else 'good'}: {peak}.")
            else:
                rejected.append(fault)
                tell(f"{fault} This hit does not count: wait until nothing moves.")
            if lost is not None:
                raise lost
            if fault:
                _wait_until_calm(source, calm, options)
            elif len(hits) >= options.least_hits:
                found, missing = _judge(hits, options, hanger)
                for n, hit in enumerate(found.hits if found else (), start=1):
                    if not hit.used:
                        tell(f"Hit {n} is left out: {hit.reason}.")
                tell(f"The modes are not good enough yet: {missing}." if missing else "Enough.")
                if not missing:
                    break
    except DeviceLost as error:
        lost_by = error.message
    except KeyboardInterrupt:
        missing = "stopped before the modes were good enough"
    if hits and found is None:
        found, missing = _judge(hits, options, hanger)
    return Acquired(tuple(hits), tuple(rejected), found, missing, lost_by)


def _check_levels(
    source: _Input, channels: Sequence[Channel], tell: Tell, options: AcquireOptions
) -> FloatArray:
    """Return the standard deviation of each channel (channels,) while nothing moves."""
    tell(f"Levels: let nothing move for {options.quiet_s:g} s.")
    blocks, faults = zip(*(source.read() for _ in range(round(options.quiet_s / options.block_s))),
                         strict=True)  # fmt: skip
    sds: FloatArray = np.concatenate(blocks[1:], axis=1).std(axis=1)  # the first fills a filter
    for channel, sd in zip(channels, sds, strict=True):
        unit = "N" if channel.quantity == "force" else "m/s2"
        tell(f"  {channel.name}: noise {sd:.2g} {unit} of {channel.full_scale:.4g} {unit}")
        if sd == 0 or any(faults):
            raise BadInput(
                max(faults) or f"channel {channel.name} is dead.",
                remedy="Check its cable, the supply of its sensor (IEPE, 48 V) and the input gain.",
            )
    return sds


def _record_hit(
    source: _Input, channels: Sequence[Channel], options: AcquireOptions
) -> tuple[FloatArray, str, DeviceLost | None]:
    """Return a hit with its ring-down, why it does not count, and how the device was lost in it."""
    trigger = options.trigger_share * channels[0].full_scale
    before = round(options.pre_trigger_s / options.block_s) + 1
    blocks: list[FloatArray] = []
    fault = ""
    while not blocks or np.abs(blocks[-1][0]).max() < trigger:
        block, fault = source.read()
        blocks = [*blocks[-before:], block]
    if fault:
        return np.concatenate(blocks, axis=1), fault, None
    for _ in range(round(options.seconds / options.block_s)):
        try:
            block, fault = source.read()
        except DeviceLost as error:
            return np.concatenate(blocks, axis=1), "", error
        blocks.append(block)
        pulses = find_pulses(np.concatenate([each[0] for each in blocks]), source.rate_hz)
        if len(pulses) > 1 or any(pulse.second_peak > 0 for pulse in pulses):
            fault = fault or "Double hit: hit once, and let the hammer spring back."
        if fault:
            break
    return np.concatenate(blocks, axis=1), fault, None


def _wait_until_calm(source: _Input, calm: FloatArray, options: AcquireOptions) -> None:
    """Read on until no sensor moves more than at rest, as long as a hit at most."""
    for _ in range(round(options.seconds / options.block_s)):
        block, _ = source.read()
        if np.all(block.std(axis=1) < 3 * calm):
            return


def _recording(
    values: FloatArray,
    rate_hz: float,
    channels: Sequence[Channel],
    hanger: Hanger | None,
    time: datetime | None,
) -> Recording:
    filled = (replace(each, values=row) for each, row in zip(channels, values, strict=True))
    return Recording("", tuple(filled), rate_hz, hanger.id if hanger else None, time)


def _judge(
    hits: Sequence[Recording], options: AcquireOptions, hanger: Hanger | None
) -> tuple[Identification | None, str]:
    """Return what the hits give, and what is not good enough; empty where all is."""
    try:
        found = identify(hits, IdentifyOptions(), test_id="acquired", hanger=hanger)
    except BadInput as reason:
        return None, reason.message.rstrip(".")
    warned = [each for each in found.quality if each.verdict == "warning"]
    checks = [f"{each.name}: {each.found}" for each in warned if each.name in _MORE_HITS_HELP]
    modes = found.test.modes
    worst = max(modes, key=lambda mode: mode.frequency_sd_hz / mode.frequency_hz, default=None)
    if worst is None:
        checks.append("no mode has a number")
    elif not worst.frequency_sd_hz <= options.precision * worst.frequency_hz:
        sd = 100 * worst.frequency_sd_hz / worst.frequency_hz
        checks.append(
            f"the {worst.plane} mode of {worst.frequency_hz:.4g} Hz is known to {sd:.2g} %"
        )
    return found, "; ".join(checks)
