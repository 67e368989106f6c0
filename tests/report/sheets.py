"""Sheets of hammer tests made by hand: modes, records, responses and poles that fit together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

from shm.identify import Dropped, Hit, Identification, Poles
from shm.report.contents import ModalTestReport
from shm.values import (
    NAN,
    PLANES,
    Channel,
    ComplexArray,
    FloatArray,
    ForeignMode,
    FrequencyResponse,
    Hanger,
    ModalTest,
    Mode,
    Plane,
    QualityCheck,
    Recording,
    ResponsePoint,
    ShapePoint,
)

LENGTH_M = 12.0
HANGER = Hanger(3, LENGTH_M, 200e9, 0.013273, 1.4019e-5, 103.5, 711e3, name="north")
TIME = datetime(2026, 5, 1, 10, tzinfo=UTC)
RATE_HZ = 256.0
SLOT_S = 4.0
FIRST_HZ: dict[Plane, float] = {"transverse": 5.8, "longitudinal": 6.1}
DAMPING = 0.004


def make_modes(orders: int = 6, places_m: Sequence[float] = (2.5, 4.4)) -> tuple[Mode, ...]:
    """Of both planes, shapes of a string, standard deviations known."""
    return tuple(
        Mode(
            plane,
            order,
            FIRST_HZ[plane] * order,
            0.001 * order,
            DAMPING,
            0.0002,
            tuple(
                ShapePoint(x_m, float(np.sin(order * np.pi * x_m / LENGTH_M)), 0.02, 0.01)
                for x_m in places_m
            ),
            0.4 / order,
        )
        for plane in PLANES
        for order in range(1, orders + 1)
    )


def make_points(places_m: Sequence[float] = (2.5, 4.4)) -> tuple[ResponsePoint, ...]:
    return tuple(
        ResponsePoint(f"acc_{2 * number + row + 1}", plane, x_m)
        for number, x_m in enumerate(places_m)
        for row, plane in enumerate(PLANES)
    )


def accelerance(
    modes: Sequence[Mode], points: Sequence[ResponsePoint], frequency_hz: FloatArray
) -> ComplexArray:
    """Modal sum at each point, (points, lines): each mode is seen in its own plane alone."""
    lines = np.zeros((len(points), len(frequency_hz)), complex)
    for mode in modes:
        ratio = frequency_hz / mode.frequency_hz
        share = -0.004 * ratio**2 / (1 - ratio**2 + 2j * mode.damping_ratio * ratio)
        for row, point in enumerate(points):
            if point.plane in (None, mode.plane):
                lines[row] += np.sin(mode.order * np.pi * point.x_m / LENGTH_M) * share
    return lines


def make_response(
    modes: Sequence[Mode], points: Sequence[ResponsePoint], coherent: bool = True
) -> FrequencyResponse:
    frequency_hz = np.arange(0, 100, 0.1)
    lines = accelerance(modes, points, frequency_hz)
    rng = np.random.default_rng(5)
    lines = lines + 2e-5 * (rng.normal(size=lines.shape) + 1j * rng.normal(size=lines.shape))
    coherence = np.clip(1 - 1e-7 / np.abs(lines) ** 2, 0.02, 1) if coherent else None
    return FrequencyResponse("made.csv", tuple(points), frequency_hz, lines, coherence, 3)


def make_recording(
    modes: Sequence[Mode], points: Sequence[ResponsePoint], hits: int, slot_s: float = SLOT_S,
    rate_hz: float = RATE_HZ,
) -> Recording:  # fmt: skip
    """Return a hit a slot, half a second into it; none at all where `hits` is 0."""
    slot = round(slot_s * rate_hz)
    samples = max(hits, 3) * slot
    time_s = np.arange(slot) / rate_hz
    rng = np.random.default_rng(7)
    force = 0.5 * rng.normal(size=samples)
    motion = 1e-3 * rng.normal(size=(len(points), samples))
    decay = sum(
        np.exp(-2 * np.pi * m.frequency_hz * DAMPING * time_s)
        * np.sin(2 * np.pi * m.frequency_hz * time_s)
        for m in modes
    )
    for hit in range(hits):
        start = hit * slot + round(0.5 * rate_hz)
        force[start : start + 3] += (900.0 + 50 * hit) * np.array([0.5, 1.0, 0.5])
        motion[:, start : (hit + 1) * slot] += decay[: slot - round(0.5 * rate_hz)]
    channels = [
        Channel(point.name, "acceleration", values, point.plane, point.x_m)
        for point, values in zip(points, motion, strict=True)
    ]
    if hits:
        channels.insert(0, Channel("force", "force", force, None, 1.9))
    return Recording("made.csv", tuple(channels), rate_hz, 3, TIME, 12.0)


def make_hits(count: int, dropped: dict[int, str], slot_s: float = SLOT_S) -> tuple[Hit, ...]:
    """Of one record; `dropped` gives the reason by the number of the hit from 1."""
    return tuple(
        Hit(
            0,
            round((number * slot_s + 0.5) * RATE_HZ),
            number * slot_s + 0.5,
            900.0 + 50 * number,
            number + 1 not in dropped,
            dropped.get(number + 1, ""),
        )
        for number in range(count)
    )


def make_poles(modes: Sequence[Mode], orders: int = 20) -> Poles:
    """Each mode at every order from 6 up, and one pole beside them at each that is not stable."""
    order = np.repeat(np.arange(2.0, 2 * orders + 2, 2), len(modes) + 1)
    frequency_hz = np.tile([*(mode.frequency_hz for mode in modes), 29.9], orders)
    strays = np.tile([*[False] * len(modes), True], orders)
    stable = ~strays & (order >= 6)
    return Poles(order, frequency_hz, np.full(len(order), DAMPING), stable)


def make_sheet(
    hits: int = 5,
    dropped: dict[int, str] | None = None,
    places_m: Sequence[float] = (2.5, 4.4),
    orders: int = 6,
) -> ModalTestReport:
    """Return a test of both planes with biaxial sensors and every part of its identification."""
    modes, points = make_modes(orders, places_m), make_points(places_m)
    response = make_response(modes, points, coherent=hits > 1)
    left = tuple(Dropped("hits", 1, reason) for reason in (dropped or {}).values())
    found = Identification(
        test=ModalTest("t1", modes, 3, TIME, 12.0, amplitude=0.97),
        frequency_response=response,
        hits=make_hits(hits, dropped or {}),
        dropped=(*left, Dropped("poles", 41, "not stable over the model orders")),
        poles=make_poles(modes),
        fit=accelerance(modes, points, response.frequency_hz),
        band_hz=(2.0, 90.0),
    )
    return ModalTestReport(found, (make_recording(modes, points, hits),), HANGER)


def without_records(sheet: ModalTestReport) -> ModalTestReport:
    """Neither its records nor the hanger at hand, and nobody says which band was asked for."""
    found = replace(sheet.identification, band_hz=None)
    return replace(sheet, identification=found, records=(), hanger=None)


def warned(sheet: ModalTestReport) -> ModalTestReport:
    """With every verdict but refused, three resonances set aside and a note."""
    quality = (
        QualityCheck("double hits", "warning", 1, 0, "hits", "hit 2 struck twice", "Hit freely."),
        QualityCheck("clipping", "good", 0.21, 0.95, "", "largest value at 21 % of full scale"),
        QualityCheck("force spectrum", "good", 240.0, 100.0, "Hz", "reaches the band"),
        QualityCheck("tones", "warning", 14.0, 10.0, "dB", _LONG_FINDING, _LONG_REMEDY),
        QualityCheck("cross-check", "unknown", NAN, 0.2, "%", "no second identifier was asked"),
    )
    set_aside = (
        ForeignMode("harmonic", 11.6, 0.004, "twice the frequency of transverse 1"),
        ForeignMode("tone", 50.0, NAN, "mains"),
        ForeignMode("deck", 3.1, 0.012, "moves all sensors alike"),
    )
    notes = ("transverse order 4 was not found; the others keep their numbers",)
    found = replace(sheet.identification, quality=quality, set_aside=set_aside, notes=notes)
    return replace(sheet, identification=found)


def refused(sheet: ModalTestReport) -> ModalTestReport:
    check = QualityCheck("noise", "refused", 3.0, 10.0, "dB", "noise everywhere", "Hit harder.")
    return replace(sheet, identification=replace(sheet.identification, quality=(check,)))


def given_responses() -> ModalTestReport:
    """Nine responses of a roving hammer on one line, plane and hanger unknown, no time record."""
    places_m = (0.1, 1.4, 2.6, 3.9, 5.2, 6.4, 7.7, 9.0, 10.2)
    modes = tuple(mode for mode in make_modes(4, places_m) if mode.plane == "transverse")
    modes = tuple(
        replace(m, shape=tuple(replace(p, cross=NAN) for p in m.shape), damping_sd=NAN)
        for m in modes
    )
    points = tuple(ResponsePoint(f"point {n}", None, x_m) for n, x_m in enumerate(places_m, 1))
    response = make_response(modes, points, coherent=False)
    found = Identification(
        ModalTest("beam", modes), response, (), (), make_poles(modes), ("no plane is stated",)
    )
    parts = tuple(
        replace(response, points=(point,), accelerance=response.accelerance[row : row + 1])
        for row, point in enumerate(points)
    )
    return ModalTestReport(found, parts)


def one_sensor() -> ModalTestReport:
    """Five records of one hit each, one sensor, neither its plane nor its place known."""
    modes = tuple(replace(m, shape=()) for m in make_modes(4) if m.plane == "transverse")
    point = ResponsePoint("acc", None, NAN)
    record = make_recording(modes, [point], 1)
    hits = tuple(replace(make_hits(1, {})[0], record=number) for number in range(5))
    points = (replace(point, x_m=2.5),)
    response = replace(make_response(modes, points), points=(point,))
    found = Identification(ModalTest("hits", modes), response, hits, (), make_poles(modes))
    records = tuple(replace(record, source=f"hit_{number}.csv") for number in range(1, 6))
    return ModalTestReport(found, records)


def ambient() -> ModalTestReport:
    """Nobody hit: accelerations alone."""
    sheet = make_sheet()
    modes, points = sheet.modes, make_points()
    record = make_recording(modes, points, 0, slot_s=40.0)
    rng = np.random.default_rng(3)
    time_s = np.arange(record.samples) / record.sampling_rate_hz
    motion = [
        sum(np.sin(2 * np.pi * m.frequency_hz * time_s) for m in modes if m.plane == c.plane)
        + 0.01 * rng.normal(size=record.samples)
        for c in record.accelerations
    ]
    channels = tuple(
        replace(c, values=np.asarray(v)) for c, v in zip(record.channels, motion, strict=True)
    )
    found = replace(sheet.identification, frequency_response=None, fit=None, hits=())
    return replace(sheet, identification=found, records=(replace(record, channels=channels),))


_LONG_FINDING = (
    "a steady tone at 50.0 Hz (mains) stands 14 dB over the noise in acc_1 and acc_3, whether "
    "somebody hits or not"
)
_LONG_REMEDY = (
    "Move the cables of acc_1 and acc_3 away from the mains, run the logger on its battery, and "
    "repeat the test."
)


EIGHT_M = (0.9, 2.1, 3.4, 4.6, 5.8, 7.1, 8.3, 9.6)
SHEETS: dict[str, Callable[[], ModalTestReport]] = {
    "two sensors": make_sheet,
    "eight sensors": lambda: make_sheet(places_m=EIGHT_M, orders=12),
    "dropped hits": lambda: make_sheet(
        hits=6, dropped={2: "double hit", 5: "not-a-number samples"}
    ),
    "single hit": lambda: make_sheet(hits=1),
    "given responses": given_responses,
    "one sensor": one_sensor,
    "ambient": ambient,
    "warned": lambda: warned(make_sheet()),
    "refused": lambda: refused(make_sheet()),
    "no records": lambda: without_records(make_sheet()),
}
