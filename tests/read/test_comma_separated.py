from __future__ import annotations

import math
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from shm.errors import BadInput, UsageError
from shm.read import peek, read, write
from shm.values import Channel, Recording

HEAD = """\
# hanger: 3
# time: 2026-05-01T12:00:00+02:00
# temperature_c: 12.5
# sampling_rate_hz: 512
# plane: , transverse, longitudinal
# unit: N, m/s2, m/s2
# x_m: 1.92, 2.52, 2.52
"""
NAMES = "force,acc_1,acc_2"
ROWS = "".join(f"{i},{0.5 * i},{-i}\n" for i in range(20))


def csv(folder: Path, text: str | bytes, name: str = "test.csv") -> Path:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def recorded(folder: Path, text: str | bytes) -> Recording:
    found = read(csv(folder, text))
    assert isinstance(found, Recording)
    return found


def timed(times: list[float], *, rate: str = "", digits: int = 6) -> str:
    rows = "".join(f"{t:.{digits}f},{i},{-i}\n" for i, t in enumerate(times))
    return f"{rate}# unit: s, N, m/s2\ntime,force,acc_1\n{rows}"


def assert_reads_as_usual(found: Recording) -> None:
    assert found.hanger == 3
    assert found.time == datetime(2026, 5, 1, 10, tzinfo=UTC)
    assert found.temperature_c == 12.5
    assert found.sampling_rate_hz == 512
    told = [(c.name, c.quantity, c.plane, c.x_m) for c in found.channels]
    assert told == [
        ("force", "force", None, 1.92),
        ("acc_1", "acceleration", "transverse", 2.52),
        ("acc_2", "acceleration", "longitudinal", 2.52),
    ]
    index = np.arange(20.0)
    np.testing.assert_array_equal([c.values for c in found.channels], [index, 0.5 * index, -index])


def test_a_file_as_described_is_read(tmp_path: Path) -> None:
    assert_reads_as_usual(recorded(tmp_path, f"{HEAD}{NAMES}\n{ROWS}"))


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace("\n", "\r\n"),
        lambda text: text.replace("\n", "\r"),
        lambda text: "\ufeff" + text,
        lambda text: text.encode("utf-16"),
        lambda text: text + "\n\n  \n",
        lambda text: text + "\x1a",
        lambda text: text.replace("# ", "#"),
        lambda text: text.replace("# hanger", "# Hanger"),
        lambda text: "# Hanger: 03\n" + text,
        lambda text: "# sampling_rate_hz: 512.0 Hz\n" + text,
        lambda text: "# time: 2026-05-01T10:00:00Z\n" + text,
        lambda text: text.replace("m/s2", "m/s²").encode("latin-1"),
        lambda text: text.replace("m/s2", "m/s^2"),
        lambda text: text.replace("m/s2", "[m/s²]"),
        lambda text: text.replace(",0.5,", ", 0.5 ,"),
        lambda text: text.replace("3,1.5,-3\n", "3,1.5,-3\n# the crew sneezed\n"),
        lambda text: text.replace("# hanger: 3", "# hanger: 3,,"),
        lambda text: text.replace("# hanger", "# crew: Ann, Bo\n# hanger"),
        lambda text: text.replace('# unit: N, m/s2, m/s2', '"# unit: N, m/s2, m/s2"'),
        lambda text: text.replace("# plane: , transverse", "# plane: transverse"),
        lambda text: text.replace("# x_m: 1.92, 2.52, 2.52", "# x_m: 1.92, 2.52,2.52 "),
        lambda text: text.replace(",", ";").replace(".5", ",5").replace(".92", ",92"),
        lambda text: text.replace(",", "\t"),
        lambda text: text.replace(",", "\t").replace(".5", ",5"),
        lambda text: text.replace(NAMES, '"force","acc_1","acc_2"'),
        lambda text: text.replace(
            "# unit: N, m/s2, m/s2",
            "# force.unit: N\n# acc_1.unit: m/s2\n# unit.acc_2: m/s2",
        ),
    ],
)  # fmt: skip
def test_what_loggers_and_spreadsheets_make_of_it_is_read_too(
    tmp_path: Path, change: object
) -> None:
    assert callable(change)
    assert_reads_as_usual(recorded(tmp_path, change(f"{HEAD}{NAMES}\n{ROWS}")))


def test_names_say_what_is_measured_where_no_unit_does(tmp_path: Path) -> None:
    found = recorded(tmp_path, f"# sampling_rate_hz: 512\n{NAMES}\n{ROWS}")
    assert [c.quantity for c in found.channels] == ["force", "acceleration", "acceleration"]
    assert not any(c.states_unit for c in found.channels)
    assert found.hanger is None
    assert found.time is None
    assert math.isnan(found.temperature_c)


def test_empty_cells_and_nan_are_gaps(tmp_path: Path) -> None:
    rows = ROWS.replace("4,2.0,-4", "4,,-4").replace("6,3.0,-6", "6,3.0,nan")
    found = recorded(tmp_path, f"{HEAD}{NAMES}\n{rows}")
    gaps = [np.flatnonzero(np.isnan(c.values)).tolist() for c in found.channels]
    assert gaps == [[], [4], [6]]


def test_a_column_of_times_gives_the_rate(tmp_path: Path) -> None:
    found = recorded(tmp_path, timed([i / 512 for i in range(100)]))
    assert found.sampling_rate_hz == pytest.approx(512, rel=1e-5)
    assert [c.name for c in found.channels] == ["force", "acc_1"]
    assert peek(tmp_path / "test.csv").sampling_rate_hz == pytest.approx(512, rel=1e-5)


def test_times_rounded_to_milliseconds_are_even_enough(tmp_path: Path) -> None:
    found = recorded(tmp_path, timed([i / 512 for i in range(2000)], digits=3))
    assert found.sampling_rate_hz == pytest.approx(512, rel=1e-3)
    assert found.samples == 2000


@pytest.mark.parametrize("lost", [3, 50, 98])
def test_a_sample_that_the_times_skip_becomes_a_gap(tmp_path: Path, lost: int) -> None:
    found = recorded(tmp_path, timed([i / 512 for i in range(100) if i not in (lost, lost - 1)]))
    assert found.sampling_rate_hz == pytest.approx(512, rel=1e-5)
    assert found.samples == 100
    for channel in found.channels:
        assert np.flatnonzero(np.isnan(channel.values)).tolist() == [lost - 1, lost]


def test_a_rate_that_the_times_contradict_is_refused(tmp_path: Path) -> None:
    text = timed([i / 500 for i in range(100)], rate="# sampling_rate_hz: 512\n")
    with pytest.raises(BadInput, match=r"line 1: sampling_rate_hz = 512, but .* 500 Hz"):
        recorded(tmp_path, text)


@pytest.mark.parametrize(
    ("times", "line", "words"),
    [
        ([0.0, 0.1, 0.2, 0.15, *np.arange(0.4, 3, 0.1)], 6, "does not increase"),
        ([*np.arange(0, 2, 0.1), 500.0], 23, "long gap"),
        ([*np.arange(0, 1, 0.1), 0.95, *np.arange(1, 2, 0.1)], 13, "uneven"),
    ],
)
def test_times_that_run_unevenly_are_refused_at_their_line(
    tmp_path: Path, times: list[float], line: int, words: str
) -> None:
    with pytest.raises(BadInput, match=words) as refusal:
        recorded(tmp_path, timed(times))
    assert (refusal.value.channel, refusal.value.line) == ("time", line)
    assert any(words in problem for problem in peek(tmp_path / "test.csv").problems)


WHOLE = f"{HEAD}{NAMES}\n{ROWS}"


@pytest.mark.parametrize(
    ("text", "where", "words"),
    [
        (WHOLE.replace("4,2.0,-4", "4,2.0"), "test.csv, line 13", "2 values where .* are 3"),
        (WHOLE.replace("4,2.0,-4", "4,2;0,-4"), "test.csv, line 13, channel acc_1", "'2;0' is not"),
        (WHOLE.replace("4,2.0,-4", "oops,2,-4"), "test.csv, line 13, channel force", "'oops'"),
        (WHOLE.replace("4,2.0,-4", "4,inf,-4"), "test.csv, line 13, channel acc_1", "infinite"),
        (WHOLE.replace("4,2.0,-4", "4,2,-1e999"), "test.csv, line 13, channel acc_2", "infinite"),
        (f"{HEAD}{NAMES}\n" + "1,2\n" * 20, "test.csv, line 9", "2 values where .* are 3"),
        (timed([0.0]), "test.csv", "sampling rate is missing"),
        (WHOLE.replace("hanger: 3", "hanger: third"), "test.csv, line 1", "'third' is not"),
        (WHOLE.replace("2026-05-01T12", "yesterday"), "test.csv, line 2", "ISO 8601"),
        (WHOLE.replace("12.5", "warm"), "test.csv, line 3", "'warm' is not a number"),
        (WHOLE.replace("512", "fast"), "test.csv, line 4", "'fast' is not a number"),
        (WHOLE.replace("512", "nan"), "test.csv, line 4", "not positive"),
        (WHOLE.replace("# sampling_rate_hz: 512\n", ""), "test.csv", "sampling rate is missing"),
        (WHOLE.replace(", longitudinal", ", up"), "test.csv, line 5, channel acc_2", "'up'"),
        (WHOLE.replace("N, m/s2, m/s2", "N, mV, m/s2"), "test.csv, line 6, channel acc_1", "'mV'"),
        (WHOLE.replace("N, m/s2, m/s2", "g, m/s2, m/s2"), "test.csv, line 6, channel force", "'g'"),
        (WHOLE.replace("N, m/s2, m/s2", "N, m/s2"), "test.csv, line 6", "2 values for 3 channels"),
        (WHOLE.replace("1.92, 2.52", "1.92, far"), "test.csv, line 7, channel acc_1", "'far'"),
        (WHOLE.replace(NAMES, "force,acc_1,acc_1"), "test.csv, line 8, channel acc_1", "twice"),
        (f"# sampling_rate_hz: 256\n{WHOLE}", "test.csv, line 5", "= 512, but line 1 states 256"),
        (f"# acc_2.unit: g\n{WHOLE}", "test.csv, line 7, channel acc_2", "but line 1 states g"),
        (
            WHOLE.replace(NAMES, "force,acc_1,acc_2 [g]"),
            "test.csv, line 8, channel acc_2", "unit = g, but line 6 states m/s2",
        ),
        (WHOLE.replace(NAMES, "force,,acc_2"), "test.csv, line 8", "no name"),
        (WHOLE.replace(NAMES + "\n", ""), "test.csv, line 8", "names of the columns are missing"),
        (HEAD, "test.csv", "no columns"),
        (f"{HEAD}{NAMES}\n", "test.csv", "0 samples"),
        (f"{HEAD}{NAMES}\n" + "1,,2\n" * 20, "test.csv, channel acc_1", "no number at all"),
        ("some words\nin lines\n", "test.csv, line 2, channel some words", "'in lines' is not"),
        (WHOLE.replace("1,acc_2", "1,t7").replace("2, m/s2", "2,"), "test.csv, channel t7", "unit"),
    ],
)  # fmt: skip
def test_a_fault_is_refused_with_its_place_and_a_remedy(
    tmp_path: Path, text: str, where: str, words: str
) -> None:
    assert text != WHOLE
    with pytest.raises(BadInput, match=words) as refusal:
        recorded(tmp_path, text)
    assert refusal.value.where == where
    assert refusal.value.remedy


def test_volts_of_a_calibrated_channel_are_no_other_unit(tmp_path: Path) -> None:
    names = ",".join(f"{name} [V]" for name in NAMES.split(","))
    found = recorded(tmp_path, f"{HEAD}# calibration: 2, 1, 1\n{names}\n{ROWS}")
    np.testing.assert_array_equal(found.channels[0].values, 2 * np.arange(20.0))


@pytest.mark.parametrize("time", ["Time [ms]", "time (ms)"])
def test_units_in_brackets_of_names_count(tmp_path: Path, time: str) -> None:
    rows = "".join(f"{2 * i},{i},{-i}\n" for i in range(20))
    found = recorded(tmp_path, f"# hanger: 3\n{time},Force [kN],acc_1 (mg)\n{rows}")
    assert [c.name for c in found.channels] == ["Force", "acc_1"]
    assert [c.values[1] for c in found.channels] == pytest.approx([1000.0, -9.80665e-3])
    assert found.sampling_rate_hz == pytest.approx(500)


def test_a_peek_lists_problems_and_keys_it_does_not_know(tmp_path: Path) -> None:
    text = WHOLE.replace("12.5", "warm").replace("N, m/s2", "N, mV").replace("hanger: 3", "rope: 3")
    found = peek(csv(tmp_path, text))
    problems = "\n".join(found.problems)
    assert "line 1: 'rope' is not a key" in problems
    assert "line 3: temperature_c = 'warm'" in problems
    assert "channel acc_1: the unit 'mV'" in problems
    assert len(found.problems) == 3
    assert (found.samples, found.sampling_rate_hz) == (20, 512)
    assert [(c.quantity, c.unit) for c in found.channels] == [
        ("force", "N"),
        (None, "mV"),
        ("acceleration", "m/s2"),
    ]


def test_a_name_that_cannot_head_a_column_is_not_written(
    recording: Recording, tmp_path: Path
) -> None:
    odd = Recording("", (Channel("a,b", "force", np.zeros(20)),), 10.0)
    with pytest.raises(UsageError, match="cannot head a column"):
        write(odd, tmp_path / "test.csv")
