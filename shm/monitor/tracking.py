"""The modes of a window: followed from the last known ones, from scratch where they are lost."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from zlib import crc32

import numpy as np

from shm.errors import NotIdentifiable, ShmError
from shm.identify import IdentifyOptions, identify
from shm.identify.contract import FoundMode
from shm.identify.mode_ordering.planes import shape_points
from shm.identify.options import NO_CROSS_CHECK
from shm.monitor.close_modes import Band, BandFit, CloseModes, directions, lines_of
from shm.monitor.limits import LIMITS
from shm.monitor.sensor_health import exchanged
from shm.monitor.spectrum import ALONE, REACH, Peaks, Stretch, found_peaks
from shm.monitor.windows import Judged, judged
from shm.values import (
    NAN,
    PLANES,
    Channel,
    FloatArray,
    Hanger,
    Mode,
    Recording,
    ResponsePoint,
    ShapePoint,
)
from shm.values.rounding import listed
from shm.values.stream import Piece, Stream, Window, WindowReading


def read_window(
    pieces: Sequence[Piece],
    stream: Stream,
    known: Sequence[Mode],
    hanger: Hanger,
    options: IdentifyOptions,
    is_confirmed: bool = True,
) -> WindowReading:
    """Read the modes of a window by following the last `known` ones.

    Where most of them are lost, modes are searched from scratch. If a window has followed the known
    modes (`is_confirmed`), they are searched once an hour, and what is found only counts where one
    change of tension moved all of them.
    """
    is_confirmed = is_confirmed and bool(known)
    found = judged(pieces, stream, known)
    if not found.parts:
        return WindowReading(found.window, (), "none", found.reason)
    if swap := exchanged(found.stretches, found.channels, known):
        return WindowReading(found.window, (), "none", f"{swap[0]}: {swap[1]}")
    modes = tracked(found, known, options)
    lost = [f"{m.plane} {m.order}" for m in known if not _has(modes, m)]
    why = [found.reason] if found.reason else []
    why += [f"not found: {listed(lost)}"] if lost else []
    guessed = 2 * (found.peaks.guessed if found.peaks else 0) > len(known)
    is_lost = 2 * len(modes) <= len(known) or guessed
    is_quiet = found.window.kind == "quiet"
    fresh: tuple[Mode, ...] = ()
    if is_quiet and is_lost:
        why.append("the modes are hidden by the noise of the sensors")
    if not is_quiet and _is_search_due(known, found.window, is_confirmed, is_lost):
        try:
            fresh = _from_scratch(found, stream, hanger, options)
        except ShmError as error:
            why.append(str(error))
    # What was followed where hardly any are known was a peak of the deck or of the traffic.
    is_few = len(known) <= LIMITS.few and len(fresh) > 2 * len(known)
    is_new = not is_confirmed or is_moved_by_tension(known, fresh)
    if fresh and (is_new if is_lost else is_few):
        return WindowReading(found.window, fresh, "from scratch", "; ".join(why))
    if fresh and is_lost:
        why.append(f"no change of tension explains the {len(fresh)} modes that are seen")
    # A mode that the windows after this do not show again is forgotten, and no hour has it.
    more = _exclude_strays(modes, known) if is_lost else modes + _missed(known, modes, fresh)
    return WindowReading(found.window, more, "tracked" if more else "none", "; ".join(why))


def _has(modes: Sequence[Mode], known: Mode) -> bool:
    return any(_is(mode, known) for mode in modes)


def _is(mode: Mode, known: Mode) -> bool:
    return (mode.plane, mode.order) == (known.plane, known.order)


def _is_search_due(
    known: Sequence[Mode], window: Window, is_confirmed: bool, is_lost: bool
) -> bool:
    """Return True where most modes are lost, or an order lacks in a plane, seldom."""
    if is_lost:
        return not is_confirmed or _is_due(window, LIMITS.review_few_s)
    orders = [{m.order for m in known if m.plane == plane} for plane in PLANES]
    highest = max(mode.order for mode in known)
    few_s = LIMITS.review_s if len(known) > LIMITS.few else LIMITS.review_few_s
    return any(len(each) < highest for each in orders) and _is_due(window, few_s)


def _is_due(window: Window, every_s: int) -> bool:
    """Return True once in ``every_s``, at a time of its own for each stream."""
    since_s = window.start.timestamp() + crc32(window.stream.encode()) % every_s
    return since_s % every_s < window.duration_s


def is_moved_by_tension(
    known: Sequence[Mode], fresh: Sequence[Mode], share: float = 0.1, least: int = 3
) -> bool:
    """Return True if one change of tension explains where a search finds the known modes.

    A tension adds the same x k^2 to the square of each frequency of order k, in both planes. Up to
    a `share` of its change a mode may differ, as ends and other temperatures move it.
    """
    after = {(mode.plane, mode.order): mode.frequency_hz for mode in fresh}
    pairs = [
        (mode.order, mode.frequency_hz, after[mode.plane, mode.order])
        for mode in known
        if (mode.plane, mode.order) in after
    ]
    if len(pairs) < min(least, len(known)):
        return False
    order, before_hz, after_hz = np.array(pairs).T
    added = float(np.median((after_hz**2 - before_hz**2) / order**2))
    expected = np.log(np.maximum(1 + added * order**2 / before_hz**2, 0.01)) / 2
    off = np.abs(np.log(after_hz / before_hz) - expected)
    return bool(np.all(off <= ALONE + share * np.abs(expected)))


def _exclude_strays(
    modes: tuple[Mode, ...], known: Sequence[Mode], least: int = 3
) -> tuple[Mode, ...]:
    """Exclude modes that moved while most are lost and too few are left to confirm each other.

    A peak of the deck near one of many lost modes is none of them.
    """
    if len(modes) >= least:
        return modes
    before = {(mode.plane, mode.order): mode.frequency_hz for mode in known}
    return tuple(
        mode
        for mode in modes
        if abs(mode.frequency_hz / before[mode.plane, mode.order] - 1) <= ALONE
    )


def _missed(
    known: Sequence[Mode], modes: Sequence[Mode], fresh: Sequence[Mode]
) -> tuple[Mode, ...]:
    """Return modes from scratch that are not known, each where its order puts it in its plane.

    A plane whose known modes are mostly lost gains none: its sensors see something else.
    """

    def is_between(mode: Mode) -> bool:
        its = [each for each in known if each.plane == mode.plane]
        if its and 2 * sum(_has(modes, each) for each in its) <= len(its):
            return False
        return all(
            (each.frequency_hz - mode.frequency_hz) * (each.order - mode.order) > 0
            and abs(each.frequency_hz / mode.frequency_hz - 1) > LIMITS.other_plane
            for each in its
        )

    return tuple(mode for mode in fresh if not _has(known, mode) and is_between(mode))


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
    alone = replace(options, cross_check=NO_CROSS_CHECK)
    made = identify([record], alone, test_id=record.source, hanger=hanger)
    if made.hits:
        raise NotIdentifiable(
            "what moved the hanger looks like hits.", file=record.source, remedy="Wait for wind."
        )
    return made.with_orders(record.source).test.modes


def tracked(found: Judged, known: Sequence[Mode], options: IdentifyOptions) -> tuple[Mode, ...]:
    """Return the known modes that are proven in the window, in their order.

    A plane of which most are lost is followed by itself: its ends move its modes alone.
    """
    if found.peaks is None:
        return ()
    modes = _prove(found, found.peaks, known, options)
    for plane in PLANES:
        its = [index for index, mode in enumerate(known) if mode.plane == plane]
        lost = 2 * sum(_has(modes, known[index]) for index in its) <= len(its)
        stays = any(mode.plane != plane for mode in modes)
        if lost and stays:
            moved = _move_plane(found, found.peaks, known, its)
            apart = _prove(found, moved, known, options)
            if len(apart) > len(modes) and _follow_changed_ends(
                [(known[index], mode) for index in its for mode in apart if _is(mode, known[index])]
            ):
                modes = apart
    return modes


def _move_plane(found: Judged, peaks: Peaks, known: Sequence[Mode], rows: Sequence[int]) -> Peaks:
    """Return the peaks with those of one plane's modes where they suit these best."""
    alone = found_peaks(
        found.stretches, found.channels, [known[index] for index in rows], peaks.noise
    )
    expected, hz = peaks.expected_hz.copy(), peaks.frequency_hz.copy()
    height, shapes = peaks.height_db.copy(), peaks.shapes.copy()
    expected[rows], hz[rows] = alone.frequency_hz, alone.frequency_hz
    height[rows], shapes[:, rows] = alone.height_db, alone.shapes
    return replace(peaks, expected_hz=expected, frequency_hz=hz, height_db=height, shapes=shapes)


def _follow_changed_ends(pairs: Sequence[tuple[Mode, Mode]], least: int = 3) -> bool:
    """Return True if modes of one plane, before and after, have moved as ends move them.

    That is by fractions that change evenly with the order; peaks of the deck lie anywhere.
    """
    if len(pairs) < least:
        return False
    order = np.array([before.order for before, _ in pairs])
    moved = np.log([after.frequency_hz / before.frequency_hz for before, after in pairs])
    line = np.polyval(np.polyfit(order, moved, 1), order)
    return bool(np.all(np.abs(moved - line) <= ALONE / 2) and np.ptp(np.sign(moved)) == 0)


def _prove(
    found: Judged, peaks: Peaks, known: Sequence[Mode], options: IdentifyOptions
) -> tuple[Mode, ...]:
    """Return the known modes that are proven near their peaks, in their order."""
    seen = [index for index in peaks.seen if peaks.height_db[index] > 0]
    half_hz = _half_hz(peaks, found.stretches)
    modes: dict[int, Mode] = {}
    for group in _groups(seen, known, peaks.frequency_hz, half_hz):
        modes |= _Group(found, peaks, half_hz, known, group, options).modes()
    return tuple(modes[index] for index in sorted(modes))


def _half_hz(peaks: Peaks, stretches: Sequence[Stretch]) -> FloatArray:
    """To either side of each mode, how wide its band is."""
    hz = peaks.frequency_hz
    least = LIMITS.least_lines / max(each.seconds for each in stretches)
    # Technical: of the frequency; a band's floor is taken as flat
    wide = np.minimum(LIMITS.half_widths * peaks.damping * hz, 0.03 * hz)
    half: FloatArray = np.maximum(wide, least)
    return half


def _groups(
    seen: Sequence[int], known: Sequence[Mode], hz: FloatArray, half_hz: FloatArray
) -> Iterator[list[int]]:
    """Modes of which one lies in another's band, or near it in the other plane, fitted together."""
    group: list[int] = []
    for index in sorted(seen, key=lambda each: float(hz[each])):
        if group:
            away = hz[index] - hz[group[-1]]
            other = all(known[index].plane != known[each].plane for each in group)
            near = LIMITS.other_plane * hz[index] if other else 0.0
            if away > max(near, half_hz[index], half_hz[group[-1]]):
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
        self.bands_hz = _bands(hz, half_hz, group)
        self.unit = peaks.noise
        self.found, self.peaks, self.known, self.group = found, peaks, known, group
        self.options = options
        width_hz = float(min(peaks.damping[index] * hz[index] for index in group))
        self.lines = lines_of(found.stretches, self.bands_hz, width_hz, self.unit)
        self.shapes = peaks.shapes[:, group] / self.unit[:, np.newaxis]
        self.start = self._start(hz[group], peaks.damping[group])

    def modes(self) -> dict[int, Mode]:
        """Return those that are proven, by their place among the known ones."""
        proven = self._proven()
        if proven is None:
            return {}
        fit, chosen = proven
        made = {}
        for place, index in enumerate(chosen):
            mode = self._mode(fit, place, self.group[index])
            if mode is not None:
                made[self.group[index]] = mode
        return made

    def _proven(self) -> tuple[BandFit, list[int]] | None:
        """Return the fit of the modes without each of which the lines are far less likely."""
        chosen = list(range(len(self.group)))
        start = self.start
        while chosen:
            shapes = self.shapes[:, chosen]
            band = Band(self.lines, directions(shapes), shapes, self.start.only(chosen))
            fit = band.fitted(start)
            gains = []
            for place in range(len(chosen)):
                rest = [other for other in range(len(chosen)) if other != place]
                # Technical: from the fit with the mode; what is gained later is small
                without = band.only(rest).fitted(fit.modes.only(rest), 6)
                gains.append(fit.log_likelihood - without.log_likelihood)
            weakest = int(np.argmin(gains))
            if gains[weakest] >= LIMITS.least_gain:
                return fit, chosen
            del chosen[weakest]
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
        seen = directions(self.shapes)
        along = np.real(np.einsum("xij,ik,jk->kx", self.lines.power, seen, seen))
        floor = np.quantile(along, LIMITS.floor, axis=1)[[0, -1]]
        zero = np.zeros(count)
        return CloseModes(radians, decay, power, zero, zero, np.eye(count, dtype=complex), floor)

    def _mode(self, fit: BandFit, place: int, index: int) -> Mode | None:
        """Return the mode as it is now; None where it is not the known one, or hardly known."""
        known, modes = self.known[index], fit.modes
        radians, decay = float(modes.radians_s[place]), float(modes.decay_1_s[place])
        hz, damping = radians / (2 * math.pi), decay / radians
        if not any(low < hz < high for low, high in self.bands_hz):
            return None
        unsteady = self._unsteadiness(self.shapes[:, self.group.index(index)], hz)
        sd_hz = math.sqrt(fit.covariance[place, place] * unsteady) * decay / (2 * math.pi)
        row = len(modes.power) + place
        damping_sd = damping * math.sqrt(fit.covariance[row, row] * unsteady)
        options = replace(self.options, ambient_s=sum(s.seconds for s in self.found.stretches))
        best = options.ambient_width * options.at_best(hz, damping)[0]
        if (
            damping < self.peaks.damping[index] / LIMITS.narrower
            or decay * max(each.seconds for each in self.found.stretches) < 1.0
            or damping > self.options.max_damping_ratio
            or sd_hz > hz * max(2 * self.options.max_frequency_sd, best)
            or abs(hz / known.frequency_hz - 1) > REACH
        ):
            return None
        return replace(
            known,
            frequency_hz=hz,
            frequency_sd_hz=sd_hz,
            damping_ratio=damping,
            damping_sd=damping_sd,
            shape=known.shape or self._shape(index),
            acceleration_m_s2=math.sqrt(2 * float(modes.power[place])),
        )

    def _shape(self, index: int) -> tuple[ShapePoint, ...]:
        """Return the shape by which a mode was seen that had none."""
        row = self.peaks.shapes[:, index]
        points = [ResponsePoint(c.name, c.plane, c.x_m) for c in self.found.channels]
        seen = FoundMode(NAN, NAN, NAN, NAN, row, np.full(len(row), NAN))
        return shape_points(seen, self.known[index].plane, points)

    def _unsteadiness(self, shape: FloatArray, hz: float) -> float:
        """By how much gusts raise the variance: half the kurtosis of the mode's motion in the band.

        That of steady noise is 1; where a slow change of its strength makes it more, that loud
        part of the window counts for more, and chance in it, than the length of it tells.
        """
        weight = shape / self.unit
        band = next((low, high) for low, high in self.bands_hz if low < hz < high)
        seen = [weight @ each.values[:, each.between(*band)] for each in self.found.stretches]
        strength = np.concatenate([np.abs(np.fft.ifft(each)) ** 2 * len(each) for each in seen])
        return max(1.0, float(np.mean(strength**2) / np.mean(strength) ** 2) / 2)


def _bands(hz: FloatArray, half_hz: FloatArray, group: list[int]) -> list[tuple[float, float]]:
    """Around each mode of a group; those that overlap are one.

    A neighbour's own peak is no floor: a band ends half way to a mode outside the group.
    """
    others = np.delete(hz, group)
    bands: list[tuple[float, float]] = []
    for index in group:
        low = max([hz[index] - half_hz[index], *((hz[index] + others) / 2)[others < hz[index]]])
        high = min([hz[index] + half_hz[index], *((hz[index] + others) / 2)[others > hz[index]]])
        if bands and low < bands[-1][1]:
            low, high = bands[-1][0], max(high, bands.pop()[1])
        bands.append((float(low), float(high)))
    return bands
