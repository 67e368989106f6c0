"""Text exports in the shapes of loggers.  Each function writes a recording and says what it holds.

Shapes follow public manuals and examples: HBK catman, imc FAMOS, DEWESoft X, NI (LVM specification
2.0, SignalExpress), Bruel & Kjaer PULSE, Siemens Testlab, Campbell Scientific TOA5 (LoggerNet
manual), Pico PicoLog, phyphox, Data Translation QuickDAQ.  Preambles differ by version and by what
a user ticks; what is invented is the wording, not the structure.
"""

from collections.abc import Sequence
from dataclasses import replace
from datetime import timedelta, timezone
from itertools import pairwise
from pathlib import Path

import numpy as np

from tests.worlds.logger_tables import (
    Array,
    Held,
    held,
    placed,
    relative,
    rows,
    spelt,
    stamps,
    with_comma,
)
from tests.worlds.recordings import Recording


def units_of(record: Recording, spelling: str = "m/s²") -> list[str]:
    """The units of the channels, with that of accelerations in a spelling."""
    return [spelt(c, spelling) for c in record.channels]


def with_units(record: Recording, pattern: str, spelling: str = "m/s²") -> list[str]:
    """Names and units in one cell, `{n} [{u}]`."""
    pairs = zip(record.names, units_of(record, spelling), strict=True)
    return [pattern.format(n=name, u=unit) for name, unit in pairs]


def table(
    record: Recording, form: str, separator: str, time: str = "", missing: str = ""
) -> list[str]:
    """Lines of the samples in one format, with the time in s before them where it has one."""
    columns, formats = record.data, [form] * len(record.channels)
    if time:
        columns, formats = np.column_stack([record.time_s, columns]), [time, *formats]
    return rows(columns, formats, separator, missing)


def save(
    path: Path,
    record: Recording,
    lines: Sequence[str],
    ends: str,
    encoding: str,
    *,
    names: Sequence[str] | None = None,
    units: Sequence[str | None] | str = "m/s²",
    values: Array | None = None,
    dated: bool = False,
    digits: int = 0,
    within: float = 0.0,
    rate_within: float = 1e-9,
) -> Held:
    """Write the lines; `dated` files say when, by a clock without a zone.

    `units` are a spelling of accelerations or all units; numbers have so many significant `digits`,
    or are `within` of the values.
    """
    path.write_bytes(ends.join([*lines, ""]).encode(encoding))
    kept = record.data if values is None else values
    return held(
        record,
        names=names,
        units=units_of(record, units) if isinstance(units, str) else units,
        rate_hz=record.rate_hz,
        start=record.start.replace(tzinfo=None) if dated else None,
        values=values,
        tolerance=relative(kept, digits) if digits else within,
        rate_within=rate_within,
    )


def catman(path: Path, record: Recording) -> Held:
    """HBK catman ASCII, German: 30 lines of preamble, names with units in brackets, `;`, comma.

    Latin-1.  The time column has six digits of a second; the rate stands in the preamble too.
    """
    names = [placed(c) for c in record.channels]
    titles = [f"{n} [{u}]" for n, u in zip(names, units_of(record), strict=True)]
    head = [
        "catmanEasy/AP",
        "DateiID;5012",
        f"Datum;{record.start:%d.%m.%Y}",
        f"Zeit;{record.start:%H:%M:%S}",
        "Kommentar;Hängermessung; Impulshammer",
        f"Anzahl Kanäle;{len(names) + 1}",
        f"Anzahl Werte;{len(record.data)}",
        f"Messrate [Hz];{record.rate_hz:g}".replace(".", ","),
        *[f"Kanal {i + 1};{n};MX840B;Filter: Bessel 10%;Offset 0,0" for i, n in enumerate(names)],
        *[f"Kommentar {i};" for i in range(1, 22 - len(names))],
        "",
        ";".join(["Zeit [s]", *titles]),
    ]
    lines = [*head, *with_comma(table(record, "%.6E", ";", "%.6f"))]
    found = save(path, record, lines, "\r\n", "latin-1", names=names, dated=True, digits=7)
    return replace(found, start=record.start.replace(tzinfo=None, microsecond=0))


def famos(path: Path, record: Recording) -> Held:
    """imc FAMOS ASCII: tab, names and units in quotes, comma; no rate but the time."""
    head = [("Zeit", *record.names), ("s", *units_of(record))]
    lines = ["\t".join(f'"{cell}"' for cell in cells) for cells in head]
    lines += with_comma(table(record, "%.7g", "\t", "%.7g"))
    return save(path, record, lines, "\r\n", "cp1252", digits=7, rate_within=1e-5)


def dewesoft(path: Path, record: Recording) -> Held:
    """DEWESoft X text: setup lines, names with the unit in brackets; tab; UTF-8 with its mark."""
    lines = [
        "Data file\tHanger_03.dxd",
        f"Start time\t{record.start:%m/%d/%Y %H:%M:%S}.000",
        f"Number of channels\t{len(record.channels)}",
        f"Sample rate\t{record.rate_hz:g}",
        "Store type\talways fast",
        "Post time\t0",
        "",
        "Data1",
        "\t".join(["Time (s)", *with_units(record, "{n} ({u})")]),
        *table(record, "%.6f", "\t", "%.6f"),
    ]
    return save(path, record, lines, "\r\n", "utf-8-sig", dated=True, within=5e-7)


def _lvm_head(record: Recording, comma: bool, x_columns: str) -> list[str]:
    return [
        "LabVIEW Measurement\t",
        "Writer_Version\t2",
        "Reader_Version\t2",
        "Separator\tTab",
        f"Decimal_Separator\t{',' if comma else '.'}",
        "Multi_Headings\tYes",
        f"X_Columns\t{x_columns}",
        "Time_Pref\tRelative",
        "Operator\tcrew",
        f"Date\t{record.start:%Y/%m/%d}",
        f"Time\t{record.start:%H:%M:%S}{',' if comma else '.'}0000000",
        "***End_of_Header***\t",
        "\t",
    ]


def _lvm_segment(record: Recording, first: int, last: int, comma: bool) -> list[str]:
    count = len(record.channels)
    point = "," if comma else "."
    begin = f"{first / record.rate_hz:.16E}".replace(".", point)
    step = f"{1 / record.rate_hz:.9f}".replace(".", point)

    def line(key: str, value: str) -> str:
        return "\t".join([key, *[value] * count, ""])

    return [
        f"Channels\t{count}" + "\t" * count,
        line("Samples", str(last - first)),
        line("Date", f"{record.start:%Y/%m/%d}"),
        line("Time", f"{record.start:%H:%M:%S}{point}0000000"),
        "\t".join(["Y_Unit_Label", *(spelt(c, "m/s^2") for c in record.channels), ""]),
        line("X_Dimension", "Time"),
        line("X0", begin),
        line("Delta_X", step),
        "***End_of_Header***" + "\t" * (count + 1),
        "\t".join(["X_Value", *record.names, "Comment"]),
    ]


def lvm(path: Path, record: Recording) -> Held:
    """NI LVM without an x column: the first cell of each line is empty; rate from Delta_X."""
    lines = _lvm_head(record, False, "No") + _lvm_segment(record, 0, len(record.data), False)
    lines += ["\t" + row for row in table(record, "%.6f", "\t", missing="NaN")]
    return _save_lvm(path, record, lines)


def lvm_segments(path: Path, record: Recording) -> Held:
    """NI LVM, three segments each with its own header, one x column, decimal comma.

    The segments are contiguous: X0 says where each begins.
    """
    count = len(record.data)
    body = with_comma(table(record, "%.6f", "\t", "%.6f", "NaN"))
    lines = _lvm_head(record, True, "One")
    for first, last in pairwise([0, count // 3, 2 * count // 3, count]):
        lines += [*_lvm_segment(record, first, last, True), *body[first:last], ""]
    return _save_lvm(path, record, lines[:-1])


def _save_lvm(path: Path, record: Recording, lines: Sequence[str]) -> Held:
    known = {"units": "m/s^2", "dated": True, "within": 5e-7, "rate_within": 1e-5}
    return save(path, record, lines, "\r\n", "ascii", **known)


def signal_express(path: Path, record: Recording) -> Held:
    """NI SignalExpress text: blocks of `key`, names, t0 and delta t, then the columns; no units."""
    names = [f"Dev1_ai{i} - {n}" for i, n in enumerate(record.names)]
    blocks = {
        "channel names:": names,
        "start times:": [f"{record.start:%d/%m/%Y %H:%M:%S}.000000"] * len(names),
        "dt:": [f"{1 / record.rate_hz:.6E}"] * len(names),
    }
    lines = [line for key, cells in blocks.items() for line in (key, "\t".join(cells))]
    lines += ["data:", *table(record, "%.6E", "\t", missing="NaN")]
    known = {"names": names, "units": [None] * len(names), "dated": True}
    return save(path, record, lines, "\r\n", "ascii", **known, digits=7, rate_within=1e-6)


def pulse(path: Path, record: Recording) -> Held:
    """Bruel & Kjaer PULSE text: a header for each signal, signals one after the other, index first.

    A reader has to put the blocks side by side; unit and delta t stand in each header.
    """
    lines = []
    for i, channel in enumerate(record.channels):
        lines += [
            f"Header Size:\t{12}",
            "Application:\tPULSE LabShop",
            "Data Type:\tReal",
            "X-axis type:\tLinear",
            "X-axis unit:\ts",
            f"X-axis size:\t{len(record.data)}",
            "X-axis first:\t0",
            f"X-axis delta:\t{1 / record.rate_hz:.10g}",
            f"Y-axis unit:\t{spelt(channel)}",
            f"Title1:\tTime({channel.name}) - Input",
            f"Date:\t{record.start:%Y-%m-%d}",
            f"Time:\t{record.start:%H:%M:%S}",
        ]
        values = record.data[:, i].tolist()
        step = 1 / record.rate_hz
        lines += [f"{n + 1}\t{n * step:.8e}\t{v:.6e}" for n, v in enumerate(values)]
    return save(path, record, lines, "\r\n", "latin-1", dated=True, digits=7)


def testlab(path: Path, record: Recording) -> Held:
    """Siemens Testlab CSV: a row of point names, a row of units, data; :+Y is a direction."""
    axis = {"transverse": "+Y", "longitudinal": "+Z", "vertical": "+Z", "x": "+X"}
    names = [
        f"hang:{i}:{axis[c.plane]}" if c.plane else "hang:900:S"
        for i, c in enumerate(record.channels)
    ]
    lines = [",".join(["Time", *names]), ",".join(["s", *units_of(record, "m/s^2")])]
    lines += table(record, "%.7g", ",", "%.9g")
    known = {"names": names, "units": "m/s^2", "digits": 7, "rate_within": 1e-5}
    return save(path, record, lines, "\n", "ascii", **known)


def toa5(path: Path, record: Recording) -> Held:
    """Campbell Scientific TOA5: four header lines, quoted time with fractions, record number, NAN.

    Times have a thousandth of a second at most here: the rate only follows over the whole column.
    """
    units = units_of(record, "m/s^2")
    head = [
        ["TOA5", "HANGER", "CR6", "1142", "CR6.Std.13", "CPU:hammer.CR6", "1958", "Fast"],
        ["TIMESTAMP", "RECORD", *record.names],
        ["TS", "RN", *units],
        ["", "", *["Smp"] * len(units)],
    ]
    lines = [",".join(f'"{cell}"' for cell in cells) for cells in head]
    body = table(record, "%.7g", ",", missing='"NAN"')
    for i, (when, row) in enumerate(zip(stamps(record), body, strict=True)):
        fraction = f".{when.microsecond // 1000:03d}".rstrip("0").rstrip(".")
        lines.append(f'"{when:%Y-%m-%d %H:%M:%S}{fraction}",{i},{row}')
    known = {"units": units, "dated": True, "digits": 7}
    off = 2e-3 * record.rate_hz / len(record.data)
    return save(path, record, lines, "\r\n", "ascii", **known, rate_within=off)


def picolog(path: Path, record: Recording) -> Held:
    """Pico CSV: names, units in brackets, an empty line; time in ms; `******` is overrange."""
    full = np.array([c.full_scale for c in record.channels])
    values = np.where(np.abs(record.data) >= 0.9999 * full, np.nan, record.data)
    columns = np.column_stack([1e3 * record.time_s, values])
    lines = [
        ",".join(["Time", *record.names]),
        ",".join(["(ms)", *(f"({u})" for u in units_of(record))]),
        "",
        *rows(columns, ["%.8f"] * columns.shape[1], ",", "******"),
    ]
    return save(path, record, lines, "\r\n", "utf-8", values=values, within=5e-9)


def phyphox(path: Path, record: Recording) -> Held:
    """phyphox CSV: one phone, three axes, quoted names, and times that are not evenly spaced.

    Axis z, along the hanger, has gravity.  A phone's samples come when they come: 3 % of a step.
    """
    chosen = [i for i, c in enumerate(record.channels) if c.quantity == "acceleration"][:2]
    factor = np.array([9.80665 if record.channels[i].unit == "g" else 1.0 for i in chosen])
    values = record.data[:, chosen] * factor
    names = [f"Acceleration {axis} (m/s^2)" for axis in "xyz"]
    rng = np.random.default_rng(record.seed)
    along = 9.81 + 0.01 * rng.standard_normal(len(values))
    values = np.column_stack([values] + [0.01 * np.ones(len(values))] * (2 - len(chosen)) + [along])
    late = 0.03 / record.rate_hz * rng.standard_normal(len(values))
    columns = np.column_stack([0.0123 + record.time_s + late, values])
    lines = [
        ",".join(f'"{n}"' for n in ["Time (s)", *names]),
        *rows(columns, ["%.9E"] * 4, ",", "NaN"),
    ]
    known = {"names": names, "units": ["m/s^2"] * 3, "values": values}
    return save(
        path, record, lines, "\n", "utf-8", **known, digits=9, rate_within=0.3 / len(values)
    )


def quickdaq(path: Path, record: Recording) -> Held:
    """Data Translation QuickDAQ CSV: settings as `key,value`, then index, time, volts.

    Values are volts of 100 mV/(m/s2) and 2.25 mV/N: the file does not say so.
    """
    volts = np.array(
        [0.1 if c.unit == "m/s2" else 1.0 if c.unit == "g" else 0.00225 for c in record.channels]
    )
    values = record.data * volts
    names = [f"DT9837A(00).Ain {i}" for i in range(len(volts))]
    columns = np.column_stack([np.arange(len(values)), record.time_s, values])
    lines = [
        "QuickDAQ,3.7.0.46",
        f"Acquisition Date,{record.start:%m/%d/%Y %I:%M:%S %p}",
        f"Sampling Frequency (Hz),{record.rate_hz:g}",
        f"Number of Samples,{len(values)}",
        "",
        ",".join(["Sample", "Time (s)", *(f"{n} (V)" for n in names)]),
        *rows(columns, ["%d", "%.6f", *["%.7g"] * len(names)], ",", ""),
    ]
    known = {"names": names, "units": ["V"] * len(names), "values": values}
    return save(path, record, lines, "\r\n", "ascii", **known, dated=True, digits=7)


def iso_times(path: Path, record: Recording) -> Held:
    """A CSV whose first column are ISO times with a time zone of two hours, to the microsecond."""
    there, body = timezone(timedelta(hours=2)), table(record, "%.7g", ",")
    lines = [",".join(["timestamp", *with_units(record, "{n} [{u}]", "m/s2")])]
    for when, row in zip(stamps(record), body, strict=True):
        lines.append(f"{when.astimezone(there).isoformat(timespec='microseconds')},{row}")
    off = 2e-6 * record.rate_hz / len(record.data)
    found = save(path, record, lines, "\n", "utf-8", units="m/s2", digits=7, rate_within=off)
    return replace(found, start=record.start)


def german_times(path: Path, record: Recording) -> Held:
    """`dd.mm.yyyy hh:mm:ss,fff`, comma, semicolon: day before month, whoever reads."""
    body = with_comma(table(record, "%.7g", ";", missing="---"))
    lines = [";".join(["Datum/Uhrzeit", *record.names]), ";".join(["", *units_of(record)])]
    for when, row in zip(stamps(record), body, strict=True):
        lines.append(f"{when:%d.%m.%Y %H:%M:%S},{when.microsecond // 1000:03d};{row}")
    off = 2e-3 * record.rate_hz / len(record.data)
    return save(path, record, lines, "\r\n", "latin-1", dated=True, digits=7, rate_within=off)


def utf16(path: Path, record: Recording) -> Held:
    """Excel's Unicode text: UTF-16 with its mark, tab, a separator too many at each line's end."""
    lines = ["\t".join(["Time [s]", *with_units(record, "{n} [{u}]"), ""])]
    lines += [row + "\t" for row in table(record, "%.6f", "\t", "%.6f")]
    return save(path, record, lines, "\r\n", "utf-16", within=5e-7, rate_within=1e-5)


def thousands(path: Path, record: Recording) -> Held:
    """Quoted numbers, a comma every three digits: "1,968.230"; the rate in a comment, no time."""
    titles = with_units(record, '"{n} ({u})"', "m/s2")
    lines = [f"# Sampling rate: {record.rate_hz:,.1f} Hz", ",".join(titles)]
    for row in record.data.tolist():
        lines.append(",".join('""' if v != v else f'"{v:,.5f}"' for v in row))
    return save(path, record, lines, "\n", "utf-8", units="m/s2", within=5e-6)


def statistics_tail(path: Path, record: Recording) -> Held:
    """Statistics below the data: minimum, maximum, mean, RMS as lines that look like numbers."""
    lines = [";".join(["t", *record.names]), ";".join(["s", *units_of(record)])]
    lines += [*table(record, "%.7g", ";", "%.6f"), ""]
    for label, of in (("Min", np.nanmin), ("Max", np.nanmax), ("Mean", np.nanmean)):
        lines.append(";".join([label, *(f"{v:.7g}" for v in of(record.data, axis=0))]))
    lines += [f"Number of samples;{len(record.data)}", "End of file"]
    return save(path, record, lines, "\n", "utf-8", digits=7, rate_within=1e-5)


def spectrum(path: Path, record: Recording) -> None:
    """An FFT export: amplitude over frequency.  No time record is in it: to be refused."""
    size = 2 * (min(len(record.data), 4096) // 2)
    amplitude = np.abs(np.fft.rfft(np.nan_to_num(record.data[:size]), axis=0)) * 2 / size
    columns = np.column_stack([np.fft.rfftfreq(size, 1 / record.rate_hz), amplitude])
    lines = ["FFT Spectrum;Window: Hanning;Averages: 1"]
    lines += [";".join(["Frequency [Hz]", *with_units(record, "{n} [{u}]")])]
    lines += rows(columns, ["%.4f", *["%.6e"] * len(record.channels)], ";", "")
    save(path, record, lines, "\n", "utf-8")
