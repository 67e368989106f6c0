"""Binary and fixed-width exports: UFF 58, 58b and 55, WAV, TDMS, MATLAB 5, and two to refuse.

UFF follows the University of Cincinnati's description of the datasets, WAV the RIFF of Microsoft
and IBM 1991, the sensitivity of a digital sensor The Modal Shop's USB Audio Interface Guide (24-bit
counts per m/s2), miniSEED the SEED manual 2.4.
"""

import io
import struct
from collections.abc import Callable
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.io import savemat
from scipy.signal import resample_poly

from tests.worlds.logger_tables import Held, held, placed, relative, spelt
from tests.worlds.recordings import Channel, Recording

Array = NDArray[np.float64]
_DIRECTION = {"transverse": 2, "longitudinal": 3, "vertical": 3, "x": 1}


def _uff_58_head(record: Recording, index: int, ordinate_type: int) -> list[str]:
    channel = record.channels[index]
    force = channel.quantity == "force"
    node, direction = (900, 3) if force else (index, _DIRECTION[channel.plane or "x"])
    kind, label = (13, "Force") if force else (12, "Acceleration")
    unit = "N" if force else spelt(channel, "m/s^2")
    created = f"{record.start:%d-%b-%y %H:%M:%S}".upper()

    def axis(number: int, name: str, units: str, exponents: str = "    0    0    0") -> str:
        return f"{number:10d}{exponents} {name:<20} {units:<20}"

    step = 1 / record.rate_hz
    return [
        f"{channel.name:<80}",
        f"{'PAK 5.9 Mueller-BBM, hanger, time data':<80}",
        f"{created:<80}",
        f"{placed(channel).encode('ascii', 'replace').decode():<80}",
        f"{'NONE':<80}",
        f"{1:5d}{index + 1:10d}{1:5d}{0:10d} {'NONE':<10}{node:10d}{direction:4d}"
        f" {'NONE':<10}{0:10d}{0:4d}",
        f"{ordinate_type:10d}{len(record.data):10d}{1:10d}{0.0:13.5e}{step:13.5e}{0.0:13.5e}",
        axis(17, "Time", "s"),
        axis(kind, label, unit),
        axis(0, "NONE", "NONE"),
        axis(0, "NONE", "NONE"),
    ]


def _uff_held(record: Recording, tolerance: float | Array) -> Held:
    """Six digits of the step are all that record 7 keeps of the rate."""
    return held(
        record,
        units=["N" if c.quantity == "force" else spelt(c, "m/s^2") for c in record.channels],
        rate_hz=record.rate_hz,
        start=record.start.replace(tzinfo=None),
        values=np.nan_to_num(record.data),
        tolerance=tolerance,
        rate_within=1e-5,
    )


def uff_58(path: Path, record: Recording) -> Held:
    """UFF 58 ASCII, a dataset a channel, real double precision, evenly spaced; gaps are zeros."""
    lines = []
    for i in range(len(record.channels)):
        values = np.nan_to_num(record.data[:, i]).tolist()
        body = ["".join(f"{v:20.11e}" for v in values[n : n + 4]) for n in range(0, len(values), 4)]
        lines += ["    -1", "    58", *_uff_58_head(record, i, 4), *body, "    -1"]
    path.write_text("\n".join([*lines, ""]), "ascii", newline="")
    return _uff_held(record, relative(np.nan_to_num(record.data), 12))


def uff_58b(path: Path, record: Recording) -> Held:
    """UFF 58b: the same header as text, then little-endian doubles."""
    out = io.BytesIO()
    for i in range(len(record.channels)):
        values = np.nan_to_num(record.data[:, i]).astype("<f8").tobytes()
        kind = f"    58b{1:6d}{2:6d}{11:12d}{len(values):12d}{0:6d}{0:6d}{0:12d}{0:12d}"
        head = ["    -1", kind, *_uff_58_head(record, i, 4)]
        out.write(("\n".join(head) + "\n").encode("ascii") + values + b"\n    -1\n")
    path.write_bytes(out.getvalue())
    return _uff_held(record, 0.0)


def uff_55(path: Path, record: Recording) -> None:
    """UFF 55: the modes that another program found, here the truth's; complex, three directions.

    No time record is in it.  Node n is the n-th acceleration channel's place; frequency and viscous
    damping ratio stand in record 8.
    """
    accelerations = [c for c in record.channels if c.quantity == "acceleration"]
    places = sorted({c.place_m for c in accelerations if c.place_m is not None})
    lines = []
    for number, mode in enumerate(record.truth.modes, 1):
        lines += ["    -1", "    55"]
        title = [f"Mode {number}", "Modal analysis", "NONE", "NONE", "NONE"]
        lines += [f"{t:<80}" for t in title]
        lines.append("".join(f"{v:10d}" for v in (1, 2, 2, 8, 2, 3)))
        lines.append("".join(f"{v:10d}" for v in (2, 4, 1, number)))
        real = (mode.frequency_hz, 1.0, mode.damping_ratio, 0.0)
        lines.append("".join(f"{v:13.5e}" for v in real))
        for node, place in enumerate(places, 1):
            vector = [0.0, 0.0, 0.0]
            for channel, value in zip(accelerations, mode.shape, strict=True):
                if channel.place_m == place:
                    vector[_DIRECTION[channel.plane or "x"] - 1] = value
            lines.append(f"{node:10d}")
            lines.append("".join(f"{v:13.5e}" for v in vector))
        lines.append("    -1")
    path.write_text("\n".join([*lines, ""]), "ascii", newline="")


def _riff(path: Path, format_chunk: bytes, data: bytes, info: str) -> None:
    text = info.encode("ascii") + b"\0"
    text += b"\0" * (len(text) % 2)
    comment = b"INFO" + b"ICMT" + struct.pack("<I", len(text)) + text
    body = b"WAVE"
    for name, chunk in ((b"fmt ", format_chunk), (b"LIST", comment), (b"data", data)):
        body += name + struct.pack("<I", len(chunk)) + chunk + b"\0" * (len(chunk) % 2)
    path.write_bytes(b"RIFF" + struct.pack("<I", len(body)) + body)


def digiducer(path: Path, record: Recording) -> Held:
    """A digital accelerometer as a sound card: 24 bits, 8000 Hz, its calibration in the comment.

    Both channels are one axis of one sensor: A of 20 g full scale, B of 10 g.  More clips.
    The comment has 24-bit counts per m/s2; without it the file is shares of full scale.
    """
    chosen = next(i for i, c in enumerate(record.channels) if c.quantity == "acceleration")
    factor = 9.80665 if record.channels[chosen].unit == "g" else 1.0
    ratio = Fraction(8000) / Fraction(record.rate_hz)
    motion = np.nan_to_num(record.data[:, chosen]) * factor
    motion = resample_poly(motion, ratio.numerator, ratio.denominator, padtype="mean")
    counts_per = np.array([8388608 / (20 * 9.80665), 8388608 / (10 * 9.80665)]).round()
    counts = np.clip(np.round(motion[:, None] * counts_per), -8388608, 8388607).astype("<i4")
    data = np.ascontiguousarray(counts).view("u1").reshape(-1, 4)[:, :3].tobytes()
    a, b = (int(c) for c in counts_per)
    comment = f"333D01 SN 012345 CAL A {a} B {b} counts/(m/s^2) {record.start:%y%m%d}"
    fmt = struct.pack("<HHIIHH", 1, 2, 8000, 8000 * 6, 6, 24)
    _riff(path, fmt, data, comment)
    return held(
        record,
        names=["A", "B"],
        units=["m/s^2"] * 2,
        rate_hz=8000.0,
        values=counts / counts_per,
        tolerance=1e-9,
    )


def wav_float(path: Path, record: Recording) -> Held:
    """WAV of 32-bit floats in the channels' own units; which they are, the file does not say."""
    values = np.nan_to_num(record.data).astype("<f4")
    count, rate = values.shape[1], int(record.rate_hz)
    fmt = struct.pack("<HHIIHHH", 3, count, rate, rate * 4 * count, 4 * count, 32, 0)
    _riff(path, fmt, values.tobytes(), "exported by a script")
    return held(
        record,
        names=[f"channel {i + 1}" for i in range(count)],
        units=[None] * count,
        rate_hz=float(rate),
        values=values.astype(float),
    )


def tdms(path: Path, record: Recording) -> Held:
    """NI TDMS as LabVIEW writes waveforms: wf_increment, wf_start_time, unit_string by channel."""
    from nptdms import ChannelObject, RootObject, TdmsWriter

    start = np.datetime64(record.start.replace(tzinfo=None), "us")
    objects = [RootObject(properties={"name": "Hanger", "Operator": "crew"})]
    for i, channel in enumerate(record.channels):
        properties = {
            "wf_increment": 1 / record.rate_hz,
            "wf_start_time": start,
            "wf_start_offset": 0.0,
            "wf_samples": len(record.data),
            "unit_string": spelt(channel, "m/s^2"),
        }
        objects.append(ChannelObject("Messung", channel.name, record.data[:, i], properties))
    with path.open("wb") as stream, TdmsWriter(stream) as writer:
        writer.write_segment(objects)
    return held(
        record,
        units=[spelt(c, "m/s^2") for c in record.channels],
        rate_hz=record.rate_hz,
        start=record.start,
    )


def matlab_struct(path: Path, record: Recording) -> Held:
    """MATLAB 5: one struct `meas`, as scripts save it: data, fs, names and units in cells."""
    cells = [np.array([list(text)], dtype=object) for text in (record.names, record.units)]
    meas = {
        "data": record.data,
        "fs": record.rate_hz,
        "channel_names": cells[0],
        "units": cells[1],
        "start": f"{record.start:%d-%b-%Y %H:%M:%S}",
    }
    buffer = io.BytesIO()
    savemat(buffer, {"meas": meas})
    raw = buffer.getvalue()  # the first 116 bytes hold the time of writing
    path.write_bytes(f"{'MATLAB 5.0 MAT-file, Platform: PCWIN64':<116}".encode() + raw[116:])
    return held(record, rate_hz=record.rate_hz, start=record.start.replace(tzinfo=None))


def miniseed(path: Path, record: Recording) -> None:
    """miniSEED, 32-bit counts, records of 512 bytes: real, but of seismology; to be refused."""
    channel = next(i for i, c in enumerate(record.channels) if c.quantity == "acceleration")
    values = np.nan_to_num(record.data[:, channel])
    counts = np.round(values / max(float(np.max(np.abs(values))), 1e-9) * 1e6).astype(">i4")
    out = io.BytesIO()
    edges = [*range(0, len(counts), 112), len(counts)]
    for number, (first, last) in enumerate(pairwise(edges), 1):
        when = record.start.timetuple()
        head = f"{number % 1000000:06d}D HANG 00HNYXX".encode()[:20].ljust(20)
        head += struct.pack(
            ">HHBBBBH", when.tm_year, when.tm_yday, when.tm_hour, when.tm_min, when.tm_sec, 0, 0
        )
        head += struct.pack(
            ">HhhBBBBiHH", last - first, int(record.rate_hz), 1, 0, 0, 0, 1, 0, 64, 48
        )
        head += struct.pack(">HHBBBB", 1000, 0, 3, 1, 9, 0)
        out.write((head.ljust(64, b"\0") + counts[first:last].tobytes()).ljust(512, b"\0"))
    path.write_bytes(out.getvalue())


def catman_binary(path: Path, record: Recording) -> None:
    """catman's own `.bin`: a number of the format, the place of the data, comments, then doubles.

    Its layout is the maker's and changes by version: to be refused with the remedy to export text.
    """

    def text(value: str) -> bytes:
        raw = value.encode("latin-1")
        return struct.pack("<h", len(raw)) + raw

    channels = b"".join(
        _catman_channel(i, c, len(record.data), text) for i, c in enumerate(record.channels)
    )
    head = text("Hanger") + struct.pack("<h", 0) * 2 + struct.pack("<h", len(record.channels))
    head += struct.pack("<ii", len(record.data), 0) + channels
    data = np.ascontiguousarray(record.data.T).astype("<f8").tobytes()
    path.write_bytes(struct.pack("<hi", 5012, 6 + len(head)) + head + data)


def _catman_channel(
    index: int, channel: Channel, count: int, text: Callable[[str], bytes]
) -> bytes:
    number = struct.pack("<hi", index + 1, count)
    return bytes(
        number + text(channel.name) + text(spelt(channel)) + text("") + struct.pack("<hh", 0, 8)
    )
