"""Each export is read back by a program of others, and holds what its writer says."""

import hashlib
import io
import re
import struct
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import openpyxl
import pandas as pd
import pytest
import pyuff
from nptdms import TdmsFile
from numpy.typing import NDArray
from scipy.io import loadmat, wavfile

from tests.worlds.logger_files import FORMATS, first_seconds, write
from tests.worlds.logger_tables import Held
from tests.worlds.recordings import Recording, case

# Long, and true of no code of ours: with `make bench`.
pytestmark = pytest.mark.trial

Array = NDArray[np.float64]


@cache
def sample(kind: str) -> Recording:
    """Three seconds, with the first hit in them."""
    return first_seconds(case(kind, 3), 3.0)


RECORDINGS = ("plain", "dropout_nan", "taps", "any_bridge", "clipped_force")


def table(text: str, **options: Any) -> pd.DataFrame:
    frame: pd.DataFrame = pd.read_csv(io.StringIO(text), header=None, **options)
    return frame


def after(text: str, mark: str, lines: int = 1) -> str:
    """What stands `lines` below the last line that begins with `mark`."""
    rows = text.splitlines()
    last = max(i for i, row in enumerate(rows) if row.startswith(mark))
    return "\n".join(rows[last + lines :])


def numbers(frame: pd.DataFrame, first: int, count: int) -> Array:
    return frame.iloc[:, first : first + count].to_numpy(float)


def decoded(path: Path, encoding: str = "utf-8") -> str:
    return path.read_bytes().decode(encoding).replace("\r\n", "\n")


Read = tuple[Array, Array | None]  # values, times in s


def _catman(path: Path, count: int) -> Read:
    text = after(decoded(path, "latin-1"), "Zeit [s]")
    frame = table(text, sep=";", decimal=",")
    return numbers(frame, 1, count), numbers(frame, 0, 1)[:, 0]


def _famos(path: Path, count: int) -> Read:
    frame = table(after(decoded(path, "cp1252"), '"s"'), sep="\t", decimal=",")
    return numbers(frame, 1, count), numbers(frame, 0, 1)[:, 0]


def _dewesoft(path: Path, count: int) -> Read:
    frame = table(after(decoded(path, "utf-8-sig"), "Data1", 2), sep="\t")
    return numbers(frame, 1, count), numbers(frame, 0, 1)[:, 0]


def _lvm(path: Path, count: int) -> Read:
    text = decoded(path, "ascii")
    step = float(text.split("Delta_X\t")[1].split("\t")[0])
    values = numbers(table(after(text, "X_Value"), sep="\t"), 1, count)
    return values, np.asarray(step * np.arange(len(values)), float)


def _lvm_segments(path: Path, count: int) -> Read:
    text = decoded(path, "ascii").replace(",", ".")
    assert text.count("***End_of_Header***") == 4
    blocks = [b.split("\n\n")[0] for b in re.split(r"X_Value.*\n", text)[1:]]
    frames = [table(b, sep="\t") for b in blocks]
    starts = [float(x) for x in re.findall(r"X0\t(\S+)", text)]
    assert starts == pytest.approx([numbers(f, 0, 1)[0, 0] for f in frames], abs=1e-6)
    frame = pd.concat(frames)
    return numbers(frame, 1, count), numbers(frame, 0, 1)[:, 0]


def _signal_express(path: Path, count: int) -> Read:
    text = decoded(path, "ascii")
    step = float(text.split("dt:\n")[1].split("\t")[0])
    values = numbers(table(text.split("data:\n")[1], sep="\t"), 0, count)
    return values, np.asarray(step * np.arange(len(values)), float)


def _pulse(path: Path, count: int) -> Read:
    blocks = decoded(path, "latin-1").split("Header Size:")[1:]
    assert len(blocks) == count
    frames = [table(after(b, "Time:"), sep="\t") for b in blocks]
    values = np.column_stack([f[2].to_numpy(float) for f in frames])
    return values, frames[0][1].to_numpy(float)


def _testlab(path: Path, count: int) -> Read:
    frame = table(after(decoded(path, "ascii"), "s,"), sep=",")
    return numbers(frame, 1, count), numbers(frame, 0, 1)[:, 0]


def _stamped(frame: pd.DataFrame, **how: Any) -> Array:
    when = pd.to_datetime(frame[0], **how)
    return np.asarray((when - when.iloc[0]).dt.total_seconds(), float)


def _toa5(path: Path, count: int) -> Read:
    frame = table(after(decoded(path, "ascii"), '"",""'), sep=",", na_values=["NAN"])
    assert list(frame[1]) == list(range(len(frame)))
    return numbers(frame, 2, count), _stamped(frame, format="ISO8601")


def _picolog(path: Path, count: int) -> Read:
    frame = table(after(decoded(path), "(ms)", 2), sep=",", na_values=["******"])
    return numbers(frame, 1, count), numbers(frame, 0, 1)[:, 0] / 1e3


def _phyphox(path: Path, count: int) -> Read:
    frame = table(after(decoded(path), '"Time'), sep=",")
    times = numbers(frame, 0, 1)[:, 0]
    return numbers(frame, 1, count), times - times[0]


def _quickdaq(path: Path, count: int) -> Read:
    frame = table(after(decoded(path, "ascii"), "Sample,"), sep=",")
    return numbers(frame, 2, count), numbers(frame, 1, 1)[:, 0]


def _iso_times(path: Path, count: int) -> Read:
    frame = table(after(decoded(path), "timestamp"), sep=",")
    return numbers(frame, 1, count), _stamped(frame, format="ISO8601")


def _german_times(path: Path, count: int) -> Read:
    text = after(decoded(path, "latin-1"), "Datum/Uhrzeit", 2)
    frame = table(text, sep=";", decimal=",", na_values=["---"])
    return numbers(frame, 1, count), _stamped(frame, format="%d.%m.%Y %H:%M:%S,%f")


def _utf16(path: Path, count: int) -> Read:
    frame = table(after(decoded(path, "utf-16"), "Time"), sep="\t")
    assert frame.shape[1] == count + 2
    return numbers(frame, 1, count), numbers(frame, 0, 1)[:, 0]


def _thousands(path: Path, count: int) -> Read:
    text = decoded(path)
    rate = float(text.split("rate: ")[1].split(" Hz")[0].replace(",", ""))
    rows = [re.findall(r'"([^"]*)"', line) for line in text.splitlines()[2:]]
    values = np.array([[float(c.replace(",", "") or "nan") for c in row] for row in rows])
    return values, np.arange(len(values)) / rate


def _statistics_tail(path: Path, count: int) -> Read:
    data, tail = decoded(path).split("\n\n")
    assert tail.startswith("Min;")
    frame = table(after(data, "s;"), sep=";")
    return numbers(frame, 1, count), numbers(frame, 0, 1)[:, 0]


def _uff(path: Path, count: int) -> Read:
    sets = pyuff.UFF(str(path)).read_sets()
    assert [s["type"] for s in sets] == [58] * count
    assert all(s["func_type"] == 1 for s in sets)
    return np.column_stack([s["data"] for s in sets]), np.asarray(sets[0]["x"], float)


def _digiducer(path: Path, count: int) -> Read:
    rate, counts = wavfile.read(path)
    words = re.search(rb"CAL A (\d+) B (\d+) counts", path.read_bytes())
    assert words is not None
    values = (counts / 256) / [float(w) for w in words.groups()]  # scipy shifts 24 bits up to 32
    return np.asarray(values), np.arange(len(values)) / rate


def _wav_float(path: Path, count: int) -> Read:
    rate, values = wavfile.read(path)
    return np.asarray(values, float), np.arange(len(values)) / rate


def _tdms(path: Path, count: int) -> Read:
    channels = TdmsFile.read(path)["Messung"].channels()
    return np.column_stack([c[:] for c in channels]), np.asarray(channels[0].time_track(), float)


def _matlab(path: Path, count: int) -> Read:
    meas = loadmat(path, squeeze_me=True)["meas"]
    values = np.asarray(meas["data"].item(), float)
    return values, np.arange(len(values)) / float(meas["fs"].item())


def _xlsx(path: Path, count: int) -> Read:
    book = openpyxl.load_workbook(path)
    assert book.sheetnames == ["Diagramm1", "Daten"]
    assert [len(book.chartsheets), len(book.worksheets)] == [1, 1]
    rows = list(book.worksheets[0].iter_rows(values_only=True))
    assert rows[4][0] == "Zeit"
    values = np.array(rows[6:], dtype=float)
    return values[:, 1:], values[:, 0]


READERS: dict[str, Callable[[Path, int], Read]] = {
    "catman": _catman,
    "famos": _famos,
    "dewesoft": _dewesoft,
    "lvm": _lvm,
    "lvm_segments": _lvm_segments,
    "signal_express": _signal_express,
    "pulse": _pulse,
    "testlab": _testlab,
    "toa5": _toa5,
    "picolog": _picolog,
    "phyphox": _phyphox,
    "quickdaq": _quickdaq,
    "iso_times": _iso_times,
    "german_times": _german_times,
    "utf16": _utf16,
    "thousands": _thousands,
    "statistics_tail": _statistics_tail,
    "uff_58": _uff,
    "uff_58b": _uff,
    "digiducer": _digiducer,
    "wav_float": _wav_float,
    "tdms": _tdms,
    "matlab_struct": _matlab,
    "xlsx": _xlsx,
}


def written(name: str, kind: str, folder: Path) -> tuple[Path, Held | None]:
    path = folder / f"{kind}{FORMATS[name].suffix}"
    return path, write(name, path, sample(kind))


@pytest.mark.parametrize("kind", RECORDINGS)
@pytest.mark.parametrize("name", sorted(READERS))
def test_a_file_holds_what_its_writer_says(name: str, kind: str, tmp_path: Path) -> None:
    path, held = written(name, kind, tmp_path)
    assert held is not None
    values, times = READERS[name](path, len(held.names))
    assert values.shape == held.values.shape
    assert np.array_equal(np.isnan(values), np.isnan(held.values))
    off = np.nanmax(np.abs(values - held.values), axis=0)
    assert np.all(off <= 1.0001 * held.tolerance + 1e-12)
    assert len(held.units) == len(held.names)
    assert held.rate_hz is not None
    assert times is not None
    span_s = times[-1] - times[0]  # of times that may be rounded to a microsecond
    found = (len(times) - 1) / span_s
    assert found == pytest.approx(held.rate_hz, rel=held.rate_within + 1.1e-6 / span_s)


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_the_same_bytes_each_time(name: str, tmp_path: Path) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    digests = []
    for folder in (first, second):
        folder.mkdir()
        path, _ = written(name, "plain", folder)
        digests.append(hashlib.sha256(path.read_bytes()).hexdigest())
    assert digests[0] == digests[1]


def test_every_format_has_a_reader_or_is_no_record() -> None:
    assert len(FORMATS) >= 20
    assert {n for n, f in FORMATS.items() if f.holds == "record"} == set(READERS)
    assert sum(f.holds == "nothing" for f in FORMATS.values()) >= 2
    assert all(f.to_know and f.not_in_file for f in FORMATS.values())


def test_what_is_to_be_refused(tmp_path: Path) -> None:
    for name in ("spectrum", "miniseed", "catman_binary"):
        path, held = written(name, "plain", tmp_path)
        assert held is None
        assert path.stat().st_size > 1000
    text = decoded(written("spectrum", "plain", tmp_path)[0])
    assert text.splitlines()[1].startswith("Frequency [Hz];")
    raw = written("miniseed", "plain", tmp_path)[0].read_bytes()
    assert len(raw) % 512 == 0
    assert raw[6:7] == b"D"
    samples = [struct.unpack(">H", raw[i + 30 : i + 32])[0] for i in range(0, len(raw), 512)]
    assert sum(samples) == len(sample("plain").data)
    raw = written("catman_binary", "plain", tmp_path)[0].read_bytes()
    number, offset = struct.unpack("<hi", raw[:6])
    assert number >= 5010
    assert len(raw) - offset == sample("plain").data.size * 8
