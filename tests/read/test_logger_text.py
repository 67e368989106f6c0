"""Text as loggers write it: every quirk beside the plain numbers that it stands for."""

from __future__ import annotations

from datetime import UTC, date, datetime
from pathlib import Path

import numpy as np
import pytest

from shm.errors import BadInput
from shm.read import peek
from shm.read.logger_words import hanger_numbered, name_and_unit, sensitivity_of
from shm.read.registry import survey
from shm.read.stamps import moment, stamp_of
from tests.helpers.logger_texts import ACC, FORCE, PLAIN, RATE, SHAPES, german, rows
from tests.helpers.written import recorded, refused


def written(folder: Path, content: str | bytes, name: str = "export.csv") -> Path:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


@pytest.mark.parametrize("shape", SHAPES)
def test_every_shape_holds_the_same_numbers(shape: str, tmp_path: Path) -> None:
    found = recorded(written(tmp_path, SHAPES[shape]))
    assert found.sampling_rate_hz == pytest.approx(RATE, rel=1e-5)
    force, acceleration = found.channels
    assert (force.quantity, acceleration.quantity) == ("force", "acceleration")
    np.testing.assert_allclose(force.values, FORCE, atol=1e-9)
    np.testing.assert_allclose(acceleration.values, ACC, atol=1e-9)
    assert peek(tmp_path / "export.csv").problems == ()


def test_an_overload_is_a_gap_that_is_counted(tmp_path: Path) -> None:
    from shm.read.registry import survey

    text = "Time (s),Force (N),Acc (m/s2)\n" + PLAIN
    lines = text.splitlines()
    lines[7] = lines[7].rsplit(",", 1)[0] + ",OVL"
    path = written(tmp_path, "\n".join(lines))
    assert np.flatnonzero(np.isnan(recorded(path).channels[1].values)).tolist() == [6]
    assert [column.overloads for column in survey(path).columns] == [0, 1]


def test_preamble_and_name_say_hanger_time_temperature_and_plane(tmp_path: Path) -> None:
    head = "Messstelle: Hänger 7\nDatum;01.05.2026\nUhrzeit;10:03:12\nTemperatur;12,5 °C\n"
    head += "Zeit [s];Kraft [N];Beschl quer [m/s²]\n"
    body = rows(lambda i: f"{german(i / RATE)};{german(FORCE[i])};{german(ACC[i])}")
    found = recorded(written(tmp_path, head + body))
    assert found.hanger == 7
    assert found.time == datetime(2026, 5, 1, 10, 3, 12, tzinfo=UTC)
    assert found.temperature_c == 12.5
    assert found.channels[1].plane == "transverse"
    other = recorded(written(tmp_path, head[21:] + body, "hanger_04_a.csv"))
    assert other.hanger == 4


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "Zeit,Kraft,Acc\n" + rows(lambda i: f"{german(i / RATE)},{german(FORCE[i])},1,5"),
            "commas part the columns and the decimals",
        ),
        ("Sample rate: 2000 Hz\nTime (s),Force (N),Acc (g)\n" + PLAIN, "500 Hz"),
        ("Time (s),Force (N),Acc (g)\n" + PLAIN * 2, "does not increase"),
        (
            "Time (s),Force (N),Acc (g)\n" + PLAIN + "Time (s),Force (N),Acc (g)\n" + PLAIN,
            "second record",
        ),
        ("Force (N),Acc (g)\n" + rows(lambda i: f"{FORCE[i]},{ACC[i]}"), "rate is missing"),
        ("Time (s),Force (N),Vel (mm/s)\n" + PLAIN, "no channel holds an acceleration"),
        ("Time (s),Force,Acc 1\n" + PLAIN, "no channel holds an acceleration"),
        ("Time (s),Force (N),Acc (g)\n" + PLAIN.replace(f"{ACC[9]:.4f}", "1.x4"), "no row of 3"),
    ],
)
def test_what_must_not_be_guessed_is_refused(tmp_path: Path, text: str, words: str) -> None:
    refused(written(tmp_path, text), words)


@pytest.mark.parametrize(
    ("text", "name", "unit"),
    [
        ("Kraft [N]", "Kraft", "N"), ("acc_1_g", "acc_1", "g"), ("a in m/s²", "a", "m/s²"),
        ("Acc (top)", "Acc (top)", ""), ("Acc (m/s^2) (top)", "Acc (top)", "m/s^2"),
        ("accel (m/(s^2))", "accel", "m/(s^2)"), ("Untitled", "Untitled", ""),
        ("Acc / g", "Acc", "g"), ("Sensor m", "Sensor m", ""), ("AI 0 [V]", "AI 0", "V"),
    ],
)  # fmt: skip
def test_a_unit_is_told_from_a_name(text: str, name: str, unit: str) -> None:
    assert name_and_unit(text) == (name, unit)


def test_words_of_sensors_hangers_and_days() -> None:
    sensitivity = sensitivity_of("2,25 mV/N")
    assert sensitivity is not None
    assert sensitivity.unit_per_volt == pytest.approx(1 / 0.00225)
    assert hanger_numbered("Haenger Nr. 07 quer") == 7
    assert hanger_numbered("hanger_2026-05-01") is None
    assert hanger_numbered("hanger 3 beside hanger 4") is None
    assert moment("01.05.2026", "14:03:12") == datetime(2026, 5, 1, 14, 3, 12, tzinfo=UTC)
    ambiguous = stamp_of("05/06/2026 10:00:00")
    assert ambiguous is not None
    assert not ambiguous.is_certain()
    assert stamp_of("12.5") is None


def test_what_c_libraries_write_for_no_number_are_missing_samples(tmp_path: Path) -> None:
    tokens = ("-nan(ind)", "-1.#IND", "nan(ind)", "1.#QNAN", "-1.#IND00")
    lines = PLAIN.splitlines()
    for place, token in enumerate(tokens, start=50):
        lines[place] = f"{place / RATE:.3f},{FORCE[place]:.3f},{token}"
    path = tmp_path / "test.csv"
    path.write_text("Time [s],Force [N],Acc [m/s2]\n" + "\n".join(lines) + "\n")
    found = recorded(path)
    assert np.flatnonzero(np.isnan(found.channels[1].values)).tolist() == [*range(50, 55)]


@pytest.mark.parametrize("day", ["04/05/2026 9:41:12 PM", "04/05/2026 09:41:12"])
def test_survey_day_in_both_orders(tmp_path: Path, day: str) -> None:
    path = tmp_path / "test.csv"
    body = rows(lambda i: f"{FORCE[i]:.3f},{ACC[i]:.4f}")
    path.write_text(f"Start,{day}\nRate,500 Hz\nHammer (N),a1x (g)\n{body}")
    found = survey(path)
    assert found.time is None
    assert [each.time.date() for each in found.layout.possible_times] == [
        date(2026, 5, 4),
        date(2026, 4, 5),
    ]
    path.write_text(f"Start,05/14/2026 9:41:12 PM\nRate,500 Hz\nHammer (N),a1x (g)\n{body}")
    assert survey(path).time == datetime(2026, 5, 14, 21, 41, 12, tzinfo=UTC)


def test_a_rounded_step_gives_way_to_the_times(tmp_path: Path) -> None:
    path = tmp_path / "test.csv"
    body = rows(lambda i: f"{i / 512:.6f},{FORCE[i]:.3f},{ACC[i]:.4f}")
    path.write_text(f"Delta_X,0.001953\nX_Value,Force (N),Acc (g)\n{body}")
    assert peek(path).sampling_rate_hz == pytest.approx(512, abs=1e-3)
    path.write_text(f"Delta_X,0.00193\nX_Value,Force (N),Acc (g)\n{body}")
    assert any("the times in the data give" in problem for problem in peek(path).problems)


def test_a_unit_that_nobody_knows_is_left_with_its_column(tmp_path: Path) -> None:
    path = tmp_path / "test.csv"
    path.write_text(f"Time,Hammer,a1\ns,kp,milli-g\n{PLAIN}")
    found = survey(path)
    assert [(c.unit, c.quantity) for c in found.columns] == [("kp", "force"), ("milli-g", None)]


def test_a_load_cell_in_g_is_no_accelerometer(tmp_path: Path) -> None:
    path = tmp_path / "test.csv"
    path.write_text(f"Time [s],Load cell [g],Acc [g]\n{PLAIN}")
    assert [c.quantity for c in survey(path).columns] == [None, "acceleration"]


def test_bytes_without_a_channel_are_no_tdms(tmp_path: Path) -> None:
    path = tmp_path / "test.tdms"
    path.write_bytes(b"TDSm\x0e\0\0\0" + np.random.default_rng(1).bytes(3000))
    with pytest.raises(BadInput, match="not those of a TDMS file"):
        survey(path)


def test_two_rates_of_a_heading_are_refused(tmp_path: Path) -> None:
    rows = "".join(f"{i};{-i}\n" for i in range(60))
    path = tmp_path / "a.csv"
    path.write_text(f"Sample rate;512 Hz\nScan rate;1000 Hz\nForce [N];Acc [m/s2]\n{rows}")
    refused(path, "Sample rate: 512 Hz; Scan rate: 1000 Hz")


@pytest.mark.parametrize("mark", [-9999, 999, -999.9])
def test_a_loggers_mark_of_an_error_is_a_missing_sample(tmp_path: Path, mark: float) -> None:
    rows = "".join(f"{i};{mark if i in (4, 9) else i % 3}\n" for i in range(20))
    path = tmp_path / "a.csv"
    path.write_text(f"Sample rate;512 Hz\nForce [N];Acc [m/s2]\n{rows}")
    assert np.flatnonzero(np.isnan(recorded(path).channels[1].values)).tolist() == [4, 9]


def test_the_size_of_an_acceleration_is_no_channel(tmp_path: Path) -> None:
    rows = "".join(f"{i / 512:.5f};{i % 3};{i % 5}\n" for i in range(20))
    path = tmp_path / "a.csv"
    path.write_text(f"Time [s];Acceleration x [m/s2];Absolute acceleration [m/s2]\n{rows}")
    found = peek(path)
    assert [channel.name for channel in found.channels] == ["Acceleration x"]
    assert found.left_out == ("Absolute acceleration (no axis)",)


def test_two_rates_are_refused_unless_times_decide(tmp_path: Path) -> None:
    """As of groups of channels, of which a slow one holds temperatures."""
    heading = "[Group 1]\nSampling rate = 500 Hz\n[Group 2]\nSampling rate = 10 Hz\n"
    rows = "".join(f"{0.002 * i:.3f},{i % 7},{i % 5}\n" for i in range(200))
    path = tmp_path / "groups.txt"
    path.write_text(f"{heading}Time (s),Force (N),Acc X (m/s2)\n{rows}")
    assert recorded(path).sampling_rate_hz == pytest.approx(500)
    untimed = "".join(f"{i % 7},{i % 5}\n" for i in range(200))
    path.write_text(f"{heading}Force (N),Acc X (m/s2)\n{untimed}")
    refused(path, "several sampling rates")


def test_a_single_force_of_nines_is_a_hit(tmp_path: Path) -> None:
    rows = "".join(f"{0.002 * i:.3f},{999 if i == 90 else i % 2},{i % 5}\n" for i in range(200))
    path = tmp_path / "hit.txt"
    path.write_text(f"Time (s),Force (N),Absolute acceleration X (m/s2)\n{rows}")
    force, motion = recorded(path).channels
    assert force.values[90] == 999
    assert motion.name == "Absolute acceleration X"
