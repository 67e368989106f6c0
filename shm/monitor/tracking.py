"""The modes of a window: followed from the last known ones, from scratch where they are lost."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from shm.errors import NotIdentifiable, ShmError
from shm.identify import IdentifyOptions, identify
from shm.identify.contract import FoundMode
from shm.identify.mode_ordering.planes import shape_points
from shm.monitor.close_modes import Band, BandFit, CloseModes, lines_of
from shm.monitor.sensor_health import exchanged
from shm.monitor.spectrum import REACH, Peaks, Stretch, channel_floors
from shm.monitor.windows import Judged, judged
from shm.values import Channel, FloatArray, Hanger, Mode, Recording, ResponsePoint
from shm.values.rounding import listed
from shm.values.stream import Piece, Stream, WindowReading

_HALF_WIDTHS = 10.0
"""Of a peak, to either side of it in its band. What white force leaves out of the slope of the
motion's spectrum moves a frequency by 0.6 n z^2 of it, n half widths to a side at a damping z."""
_LEAST_LINES = 12  # judgement: to either side: a floor is known to a fifth by 24 lines
_WIDEST = 0.03  # technical: of the frequency; a band's floor is taken as flat
_LEAST_GAIN = 15.0
"""judgement: of log likelihood by which a mode is proven: its five parameters and some two hundred
places to look make 10 by chance."""
_STEPS_WITHOUT = 6  # technical: from the fit with the mode; what is gained later is small
_SHAPE_SD = 0.05  # judgement: a shape before and now; sensors stay where they are
_LEAST_LIKENESS = 0.8  # judgement: of a mode's shape with the known one; a neighbour's is below 0.5
_SAME_DIRECTION = 0.1  # judgement: modes of nearer shapes differ by frequency alone
_SAME = 3.0  # standard deviations


def read_window(
    pieces: Sequence[Piece],
    stream: Stream,
    known: Sequence[Mode],
    hanger: Hanger,
    options: IdentifyOptions,
) -> WindowReading:
    """The modes of a window by the last `known` ones; from scratch where most of them are lost."""
    found = judged(pieces, stream, known)
    if not found.parts:
        return WindowReading(found.window, (), "none", found.reason)
    if swap := exchanged(found.stretches, found.channels, known):
        return WindowReading(found.window, (), "none", f"{swap[0]}: {swap[1]}")
    modes = tracked(found, known, options)
    lost = [f"{m.plane} {m.order}" for m in known if not _has(modes, m)]
    why = [found.reason] if found.reason else []
    why += [f"not found: {listed(lost)}"] if lost else []
    if 2 * len(modes) > len(known):
        return WindowReading(found.window, modes, "tracked", "; ".join(why))
    if found.window.kind == "quiet":
        why.append("the modes are hidden by the noise of the sensors")
    else:
        try:
            return WindowReading(
                found.window, _from_scratch(found, stream, hanger, options), "from scratch",
                "; ".join(why),
            )  # fmt: skip
        except ShmError as error:
            why.append(str(error))
    return WindowReading(found.window, modes, "tracked" if modes else "none", "; ".join(why))


def _has(modes: Sequence[Mode], known: Mode) -> bool:
    return any((m.plane, m.order) == (known.plane, known.order) for m in modes)


def _from_scratch(
    found: Judged, stream: Stream, hanger: Hanger, options: IdentifyOptions
) -> tuple[Mode, ...]:
    """The modes of the used parts by `identify`, gaps between them as not-a-number samples."""
    gap = np.full((len(found.channels), 1), np.nan)
    joined = np.concatenate([each for part in found.parts for each in (part, gap)], axis=1)[:, :-1]
    record = Recording(
        source=f"{stream.name} {found.window.start:%Y-%m-%d %H:%M}",
        channels=tuple(
            Channel(c.name, "acceleration", row, c.plane, c.x_m, c.full_scale)
            for c, row in zip(found.channels, joined, strict=True)
        ),
        sampling_rate_hz=stream.sampling_rate_hz,
        hanger=stream.hanger,
        time=found.window.start,
        temperature_c=found.window.temperature_c,
    )
    made = identify([record], options, test_id=record.source, hanger=hanger)
    if made.hits:
        raise NotIdentifiable(
            "what moved the hanger looks like hits.", file=record.source, remedy="Wait for wind."
        )
    return made.test.modes


def tracked(found: Judged, known: Sequence[Mode], options: IdentifyOptions) -> tuple[Mode, ...]:
    """The known modes that are proven in the window, in their order."""
    peaks = found.peaks
    if peaks is None:
        return ()
    seen = [index for index in peaks.seen if peaks.height_db[index] > 0]
    half_hz = _half_hz(peaks, found.stretches)
    modes: dict[int, Mode] = {}
    for group in _groups(seen, peaks.frequency_hz, half_hz):
        modes |= _Group(found, peaks, half_hz, known, group, options).modes()
    return tuple(modes[index] for index in sorted(modes))


def _half_hz(peaks: Peaks, stretches: Sequence[Stretch]) -> FloatArray:
    """To either side of each mode, how wide its band is."""
    hz = peaks.frequency_hz
    least = _LEAST_LINES / max(each.seconds for each in stretches)
    wide = np.minimum(_HALF_WIDTHS * peaks.damping * hz, _WIDEST * hz)
    half: FloatArray = np.maximum(wide, least)
    return half


def _groups(seen: Sequence[int], hz: FloatArray, half_hz: FloatArray) -> Iterator[list[int]]:
    """Modes of which one lies in another's band are fitted together."""
    group: list[int] = []
    for index in sorted(seen, key=lambda each: float(hz[each])):
        if group and hz[index] - hz[group[-1]] > max(half_hz[index], half_hz[group[-1]]):
            yield group
            group = []
        group.append(index)
    if group:
        yield group


class _Group:
    """Close modes of a window, fitted together."""

    def __init__(
        self,
        found: Judged,
        peaks: Peaks,
        half_hz: FloatArray,
        known: Sequence[Mode],
        group: list[int],
        options: IdentifyOptions,
    ) -> None:
        hz = peaks.frequency_hz
        others = np.delete(hz, group)
        low = min(hz[index] - half_hz[index] for index in group)
        high = max(hz[index] + half_hz[index] for index in group)
        # A neighbour's own peak is no floor: the band ends half way to it.
        below, above = others[others < hz[group[0]]], others[others > hz[group[-1]]]
        self.low_hz = max([low, *((hz[group[0]] + below) / 2)])
        self.high_hz = min([high, *((hz[group[-1]] + above) / 2)])
        self.found, self.known, self.group, self.options = found, known, group, options
        band_hz = self.low_hz, self.high_hz
        self.unit = np.sqrt(channel_floors(found.stretches, *band_hz))
        width_hz = float(min(peaks.damping[index] * hz[index] for index in group))
        self.lines = lines_of(found.stretches, band_hz, width_hz, self.unit)
        self.shapes = peaks.shapes[:, group] / self.unit[:, np.newaxis]
        self.start = self._start(hz[group], peaks.damping[group])

    def modes(self) -> dict[int, Mode]:
        """Those that are proven, by their place among the known ones."""
        proven = self._proven()
        if proven is None:
            return {}
        fit, kept = proven
        band = self._band(self.shapes[:, kept], self.start.only(kept))
        shapes, shape_sd = band.reshaped(fit.modes, _SHAPE_SD * float(np.max(np.abs(band.shapes))))
        fit = self._band(shapes, band.known).fitted(fit.modes)
        made = {}
        for place, index in enumerate(kept):
            mode = self._mode(fit, place, self.group[index], shapes[:, place], shape_sd[place])
            if mode is not None:
                made[self.group[index]] = mode
        return made if self._in_order(made) else {}

    def _band(self, shapes: FloatArray, known: CloseModes) -> Band:
        return Band(self.lines, _directions(shapes), shapes, known)

    def _proven(self) -> tuple[BandFit, list[int]] | None:
        """The fit of the modes without each of which the lines are far less likely."""
        kept = list(range(len(self.group)))
        start = self.start
        while kept:
            band = self._band(self.shapes[:, kept], self.start.only(kept))
            fit = band.fitted(start)
            gains = []
            for place in range(len(kept)):
                rest = [other for other in range(len(kept)) if other != place]
                without = band.only(rest).fitted(fit.modes.only(rest), _STEPS_WITHOUT)
                gains.append(fit.log_likelihood - without.log_likelihood)
            weakest = int(np.argmin(gains))
            if gains[weakest] >= _LEAST_GAIN:
                return fit, kept
            del kept[weakest]
            start = fit.modes.only([p for p in range(len(gains)) if p != weakest])
        return None

    def _start(self, hz: FloatArray, damping: FloatArray) -> CloseModes:
        radians, count = 2 * math.pi * hz, len(hz)
        decay = damping * radians
        inverse = np.linalg.pinv(self.shapes, rcond=0.1)
        away = np.abs(self.lines.radians_s[:, np.newaxis] - radians)
        power = np.empty(count)
        for place in range(count):
            near = away[:, place] <= max(decay[place], float(np.min(away[:, place])))
            seen = np.real(inverse[place] @ self.lines.power[near] @ inverse[place])
            power[place] = float(np.mean(seen)) * decay[place] * 0.75
        power = np.maximum(power, 1e-6 / np.max(self.shapes**2))
        return CloseModes(radians, decay, power, np.zeros(count), np.eye(count, dtype=complex), 1.0)

    def _mode(
        self,
        fit: BandFit,
        place: int,
        index: int,
        shape: FloatArray,
        shape_sd: float,
    ) -> Mode | None:
        """The mode as it is now; None where it is not the known one, or hardly known."""
        known, modes = self.known[index], fit.modes
        radians, decay = float(modes.radians_s[place]), float(modes.decay_1_s[place])
        hz, damping = radians / (2 * math.pi), decay / radians
        unsteady = self._unsteadiness(shape)
        sd_hz = math.sqrt(fit.covariance[place, place] * unsteady) * decay / (2 * math.pi)
        row = len(modes.power) + place
        damping_sd = damping * math.sqrt(fit.covariance[row, row] * unsteady)
        whitened = self.shapes[:, self.group.index(index)]
        alike = abs(shape @ whitened) / math.sqrt(shape @ shape * (whitened @ whitened))
        options = replace(self.options, ambient_s=sum(s.seconds for s in self.found.stretches))
        best = options.ambient_width * options.at_best(hz, damping)[0]
        if (
            alike**2 < _LEAST_LIKENESS
            or damping > self.options.max_damping_ratio
            or sd_hz > hz * max(2 * self.options.max_frequency_sd, best)
            or not self.low_hz < hz < self.high_hz
            or abs(hz / known.frequency_hz - 1) > REACH
        ):
            return None
        own = shape * self.unit
        largest = float(np.max(np.abs(own)))
        found = FoundMode(
            hz, sd_hz, damping, damping_sd, own / largest, shape_sd * self.unit / largest
        )
        points = [ResponsePoint(c.name, c.plane, c.x_m) for c in self.found.channels]
        return replace(
            known,
            frequency_hz=hz,
            frequency_sd_hz=sd_hz,
            damping_ratio=damping,
            damping_sd=damping_sd,
            shape=shape_points(found, known.plane, points) or known.shape,
            acceleration_m_s2=math.sqrt(2 * float(modes.power[place])) * largest,
        )

    def _unsteadiness(self, shape: FloatArray) -> float:
        """By how much gusts raise the variance: half the kurtosis of the mode's motion in the band.

        That of steady noise is 1; where a slow change of its strength makes it more, that loud
        part of the window counts for more, and chance in it, than the length of it tells.
        """
        weight = shape / self.unit
        seen = [
            weight @ each.values[:, each.between(self.low_hz, self.high_hz)]
            for each in self.found.stretches
        ]
        strength = np.concatenate([np.abs(np.fft.ifft(each)) ** 2 * len(each) for each in seen])
        return max(1.0, float(np.mean(strength**2) / np.mean(strength) ** 2) / 2)

    def _in_order(self, made: dict[int, Mode]) -> bool:
        """Whether no two modes have exchanged their places since they were last known."""
        for one in made:
            for two in made:
                before = self.known[one].frequency_hz - self.known[two].frequency_hz
                now = made[one].frequency_hz - made[two].frequency_hz
                sd = math.hypot(made[one].frequency_sd_hz, made[two].frequency_sd_hz)
                if before > _SAME * sd and now < -_SAME * sd and abs(before + now) < _SAME * sd:
                    return False
        return True


def _directions(shapes: FloatArray) -> FloatArray:
    """Orthonormal columns (channels, directions) that span the shapes which sensors tell apart."""
    left, size, _ = np.linalg.svd(shapes / np.linalg.norm(shapes, axis=0), full_matrices=False)
    # Two directions see two planes; nearer shapes than at 6 degrees are one.
    return np.asarray(left[:, :2][:, size[:2] > _SAME_DIRECTION])
