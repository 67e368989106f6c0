"""One contract for every registered format: what is written is read, what is damaged refused."""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from shm.errors import UsageError
from shm.read import FORMATS, Format, bundle, peek, peek_test, read, sidecar_path
from shm.read import write as write_ours
from shm.values import (
    TEST_CONDITIONS,
    Channel,
    FrequencyResponse,
    Recording,
    collect_conditions,
    collect_known_conditions,
)
from tests.helpers.written import NUMBERED, needs_responses, recorded, refused, responded, write

formats = pytest.mark.parametrize(
    "file_format", [known for known in FORMATS if known.name not in NUMBERED], ids=lambda f: f.name
)
one_of_a_kind = pytest.mark.parametrize(
    "file_format",
    [known for known in FORMATS if known.name in ("HDF5", "CSV")],
    ids=lambda f: f.name,
)
"""What is checked where all formats are one: arrays, and text."""
written_formats = pytest.mark.parametrize(
    "file_format", [known for known in FORMATS if known.write], ids=lambda f: f.name
)


def path_for(file_format: Format, folder: Path) -> Path:
    return folder / f"test{file_format.suffixes[0]}"


def written(file_format: Format, recording: Recording | FrequencyResponse, folder: Path) -> Path:
    path = path_for(file_format, folder)
    write(recording, path)
    return path


def assert_same(found: Recording | FrequencyResponse, expected: Recording) -> None:
    assert isinstance(found, Recording)
    for name, stated in collect_conditions(expected).items():
        read_back = getattr(found, name)
        is_number = isinstance(stated, float)
        assert read_back == (pytest.approx(stated, nan_ok=True) if is_number else stated), name
    assert found.sampling_rate_hz == pytest.approx(expected.sampling_rate_hz, rel=1e-12)
    for one, other in zip(found.channels, expected.channels, strict=True):
        assert (one.name, one.quantity, one.plane) == (other.name, other.quantity, other.plane)
        assert one.x_m == pytest.approx(other.x_m, nan_ok=True)
        largest = np.nanmax(np.abs(other.values))
        np.testing.assert_allclose(one.values, other.values, atol=1e-8 * largest)


def test_recording_states_every_condition(recording: Recording) -> None:
    assert list(collect_known_conditions(recording)) == list(TEST_CONDITIONS), (
        "Add it to the fixture."
    )


@formats
def test_a_recording_comes_back_as_it_was_written(
    file_format: Format, recording: Recording, tmp_path: Path
) -> None:
    path = written(file_format, recording, tmp_path)
    found = read(path)
    assert_same(found, recording)
    assert found.source == str(path)


@formats
def test_what_is_unknown_stays_unknown(
    file_format: Format, recording: Recording, tmp_path: Path
) -> None:
    channels = tuple(replace(c, plane=None, x_m=math.nan) for c in recording.channels)
    bare = replace(recording, channels=channels, hanger=None, time=None, temperature_c=math.nan)
    assert_same(read(written(file_format, bare, tmp_path)), bare)


@formats
@pytest.mark.parametrize("rate", [1 / 0.003, 100.0, 51.2, 1651.6129, 65536.0])
def test_any_sampling_rate_comes_back_exactly(
    file_format: Format, recording: Recording, tmp_path: Path, rate: float
) -> None:
    found = recorded(written(file_format, replace(recording, sampling_rate_hz=rate), tmp_path))
    assert found.sampling_rate_hz == rate


@formats
def test_a_gap_stays_a_gap_or_is_refused_on_writing(
    file_format: Format, recording: Recording, tmp_path: Path
) -> None:
    values = recording.channels[1].values.copy()
    values[[0, 7, -1]] = np.nan
    gappy = replace(recording.channels[1], values=values)
    holed = replace(recording, channels=(recording.channels[0], gappy, recording.channels[2]))
    if file_format.name != "UFF":
        assert_same(read(written(file_format, holed, tmp_path)), holed)
    else:
        with pytest.raises(UsageError, match=r"gaps \(NaN\) of acc_1.*\.csv"):
            written(file_format, holed, tmp_path)
        assert list(tmp_path.iterdir()) == []


@formats
def test_a_frequency_response_comes_back_as_it_was_written(
    file_format: Format, response: FrequencyResponse, tmp_path: Path
) -> None:
    needs_responses(file_format)
    found = responded(written(file_format, response, tmp_path))
    assert (found.hanger, found.time, found.temperature_c) == (7, response.time, 8.0)
    assert found.points == response.points
    np.testing.assert_allclose(found.frequency_hz, response.frequency_hz, rtol=1e-14)
    np.testing.assert_allclose(found.accelerance, response.accelerance, rtol=1e-9)
    assert found.coherence is not None
    assert response.coherence is not None
    np.testing.assert_allclose(found.coherence, response.coherence, rtol=1e-9)


@formats
def test_a_sidecar_is_written_only_where_the_format_needs_one(
    file_format: Format, recording: Recording, tmp_path: Path
) -> None:
    path = written(file_format, recording, tmp_path)
    expected = {path, sidecar_path(path)} if file_format.name == "UFF" else {path}
    assert set(tmp_path.iterdir()) == expected


@formats
def test_a_sidecar_goes_before_the_file(
    file_format: Format, recording: Recording, tmp_path: Path
) -> None:
    path = written(file_format, recording, tmp_path)
    sidecar_path(path).write_text(
        "hanger = 11\ntime = 2026-06-01T12:00:00+02:00\ntemperature_c = 21\n"
        '[channel.acc_1]\nplane = "longitudinal"\nx_m = 9.5\n[channel.force]\nunit = "kN"\n'
    )
    for found in (read(path), peek(path)):
        assert not isinstance(found, FrequencyResponse)
        assert (found.hanger, found.temperature_c) == (11, 21.0)
        assert found.time == datetime(2026, 6, 1, 10, tzinfo=UTC)
        assert (found.channels[1].plane, found.channels[1].x_m) == ("longitudinal", 9.5)
        assert found.channels[2].plane == "longitudinal"
    whole = recorded(path)
    np.testing.assert_allclose(whole.channels[0].values, 1000 * recording.channels[0].values)


@one_of_a_kind
@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("hanger = \n", "not a readable TOML"),
        ('hanger = "three"\n', "hanger = 'three' is not a number"),
        ("hanger = 2.5\n", "whole number"),
        ("hanger = true\n", "not a number"),
        ('time = "tomorrow"\n', "not an ISO 8601"),
        ("temperature_c = inf\n", "not a number"),
        ("temperature_c = -127\n", "temperature_c = -127 is no temperature outdoors"),
        ("sampling_rate_hz = 0\n", "not positive"),
        ("channel = 3\n", "must hold tables"),
        ('[channel.acc_9]\nunit = "g"\n', "does not have"),
        ('[channel.acc_1]\nunit = "furlong"\n', "furlong"),
        ('[channel.acc_1]\nunit = "N"\n', "not one of acceleration"),
        ('[channel.acc_1]\nplane = "upwards"\n', "upwards"),
        ('[channel.acc_1]\nx_m = "far"\n', "far"),
        ('unit = ["N", "g"]\n', "2 values for 3 channels"),
        ("calibration = 10\n", "1 values for 3 channels"),
        ("[channel.acc_1]\ncalibraton = 10\n", "'calibraton' is not a key of a channel"),
        ("[channel.acc_1]\ncalibration = 0\n", "calibration = 0 is no factor"),
        ('[channel.acc_1]\ncalibration = "much"\n', "much"),
        ("[channel.acc_1]\nfull_scale = -5\n", "not positive"),
        ('[channel.acc_1]\nleave_out = "perhaps"\n', "neither true nor false"),
    ],
)
def test_a_faulty_sidecar_is_refused_by_name(
    file_format: Format, recording: Recording, tmp_path: Path, text: str, words: str
) -> None:
    path = written(file_format, recording, tmp_path)
    sidecar_path(path).write_text(text)
    refusal = refused(path, words)
    assert refusal.where.startswith("test.toml")


@one_of_a_kind
@pytest.mark.parametrize(("forces", "accelerations"), [(1, 1), (1, 16), (0, 16)])
def test_one_force_and_up_to_sixteen_accelerations_are_read(
    file_format: Format, recording: Recording, tmp_path: Path, forces: int, accelerations: int
) -> None:
    many = replace(recording, channels=channels_of(recording, forces, accelerations))
    assert_same(read(written(file_format, many, tmp_path)), many)


@one_of_a_kind
@pytest.mark.parametrize(
    ("forces", "accelerations", "words"),
    [(1, 17, "17 accelerations; at most 16"), (2, 1, "2 channels hold a force")],
)
def test_more_channels_are_refused_unless_the_sidecar_leaves_them_out(
    file_format: Format, recording: Recording, tmp_path: Path, forces: int, accelerations: int,
    words: str,
) -> None:  # fmt: skip
    channels = channels_of(recording, forces, accelerations)
    path = written(file_format, replace(recording, channels=channels), tmp_path)
    refusal = refused(path, words)
    assert "leave_out = true" in refusal.remedy
    assert any(words.split(";")[0] in problem for problem in peek(path).problems)
    out = channels[0 if forces == 2 else -1].name
    sidecar_path(path).write_text(f"[channel.{out}]\nleave_out = true\n")
    found = recorded(path)
    assert out not in [channel.name for channel in found.channels]
    assert len(found.channels) == len(channels) - 1
    look = peek(path)
    assert (look.problems, look.left_out) == ((), (out,))


def channels_of(recording: Recording, forces: int, accelerations: int) -> tuple[Channel, ...]:
    force, acceleration = recording.channels[:2]
    return (
        *(replace(force, name=f"force_{i}") for i in range(1, forces + 1)),
        *(replace(acceleration, name=f"acc_{i}") for i in range(1, accelerations + 1)),
    )


@one_of_a_kind
def test_calibration_is_applied_and_full_scale_becomes_si(
    file_format: Format, recording: Recording, tmp_path: Path
) -> None:
    """Volts times g per volt, times m/s^2 per g."""
    path = written(file_format, recording, tmp_path)
    sidecar_path(path).write_text(
        '[channel.acc_1]\nunit = "g"\ncalibration = -10.0\nfull_scale = 50\n'
        '[channel.force]\nunit = "kN"\ncalibration = 0.5\n'
    )
    found = recorded(path)
    force, first, second = found.channels
    raw = [channel.values for channel in recording.channels]
    np.testing.assert_allclose(first.values, -10 * 9.80665 * raw[1], rtol=1e-7)
    np.testing.assert_allclose(force.values, 500 * raw[0], rtol=1e-7)
    np.testing.assert_allclose(second.values, raw[2], rtol=1e-7)
    assert first.full_scale == pytest.approx(50 * 9.80665)
    assert math.isnan(force.full_scale)
    told = peek(path).channels
    assert [(c.calibration, c.full_scale) for c in told[:2]] == [
        (0.5, pytest.approx(math.nan, nan_ok=True)),
        (-10.0, 50.0),
    ]


@formats
def test_a_full_scale_comes_back(file_format: Format, recording: Recording, tmp_path: Path) -> None:
    scales = (4400.0, math.nan, 490.5)
    channels = tuple(
        replace(c, full_scale=scale) for c, scale in zip(recording.channels, scales, strict=True)
    )
    found = recorded(written(file_format, replace(recording, channels=channels), tmp_path))
    assert [c.full_scale for c in found.channels] == pytest.approx(scales, nan_ok=True)


@one_of_a_kind
def test_impossible_values_are_refused_with_their_channel(
    file_format: Format, recording: Recording, tmp_path: Path
) -> None:
    values = recording.channels[1].values.copy()
    values[4] = 3e12
    wild = (*recording.channels[:1], replace(recording.channels[1], values=values))
    path = written(file_format, replace(recording, channels=wild), tmp_path)
    refusal = refused(path, r"sample 5 is 3e\+12")
    assert refusal.channel == "acc_1"


@one_of_a_kind
@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "empty"),
        (b" \r\n\n", "empty"),
        (b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR" + bytes(range(256)), "PNG picture"),
        (b"\xff\xd8\xff\xe0\x00\x10JFIF" + bytes(range(256)), "JPEG picture"),
        (b"PK\x03\x04" + bytes(50), "ZIP archive"),
        (b"\x89HDF\r\n\x1a\n" + bytes(50), "HDF5"),
        (bytes(range(256)) * 4, "does not hold what its name says"),
    ],
)
def test_a_file_of_another_kind_is_refused(
    file_format: Format, tmp_path: Path, content: bytes, words: str
) -> None:
    path = path_for(file_format, tmp_path)
    path.write_bytes(content)
    refused(path, words, read, peek)


@formats
def test_a_file_named_as_another_format_is_told_apart(
    file_format: Format, recording: Recording, tmp_path: Path
) -> None:
    path = written(file_format, recording, tmp_path)
    for other in FORMATS:
        if other is not file_format:
            misnamed = tmp_path / f"misnamed{other.suffixes[0]}"
            misnamed.write_bytes(path.read_bytes())
            refused(misnamed, f"Rename it to {file_format.suffixes[0]}")


@formats
def test_an_unknown_suffix_is_refused_with_the_right_one(
    file_format: Format, recording: Recording, tmp_path: Path
) -> None:
    path = written(file_format, recording, tmp_path).rename(tmp_path / "test.xyz")
    refused(path, f"suffix .xyz.*rename it to {file_format.suffixes[0]}")
    with pytest.raises(UsageError, match=r"no format is written as \.xyz"):
        write(recording, path)


@written_formats
def test_a_write_that_fails_leaves_the_old_file(
    file_format: Format, recording: Recording, tmp_path: Path
) -> None:
    path = written(file_format, recording, tmp_path)
    before = {entry.name: entry.read_bytes() for entry in tmp_path.iterdir()}
    odd = replace(recording, channels=(Channel("force", "force", np.array([1.0, np.nan])),))
    broken = odd if file_format.name == "UFF" else replace(odd, channels=(
        replace(odd.channels[0], name="for,ce"),
    ))  # fmt: skip
    with pytest.raises(UsageError):
        write(broken, path)
    assert {entry.name: entry.read_bytes() for entry in tmp_path.iterdir()} == before


def test_what_is_only_read_is_refused_on_writing(recording: Recording, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"no format is written as \.mat.*\.npz, \.uff, \.csv"):
        write_ours(recording, tmp_path / "test.mat")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", ["recording", "response"])
@pytest.mark.parametrize(
    ("fault", "problem"),
    [
        ('temperature_c = "warm"', "temperature_c = 'warm' is not a number"),
        ('time = "noon"', "time = 'noon' is not an ISO 8601 time"),
        ('plane = "up"', "'up'"),
        ("added_mass_kg = -1\nadded_mass_at_m = 2", "added_mass_kg = -1 is not positive"),
        (
            "added_mass_kg = 1\nadded_mass_at_m = 2\nadded_mass_radius_m = -1",
            "added_mass_radius_m = -1 is negative",
        ),
    ],
)
@one_of_a_kind
def test_peek_lists_sidecar_faults(
    file_format: Format,
    fault: str,
    problem: str,
    kind: str,
    request: pytest.FixtureRequest,
    tmp_path: Path,
) -> None:
    """A fault of the sidecar hides no channel, in whatever format."""
    if kind == "response":
        needs_responses(file_format)
    path = written(file_format, request.getfixturevalue(kind), tmp_path)
    names = [channel.name for channel in peek(path).channels]
    sidecar_path(path).write_text(f"{fault}\n")
    look = peek(path)
    assert [channel.name for channel in look.channels] == names
    assert look.problems
    assert all(problem in each and "test.toml" in each for each in look.problems)


def test_peek_lists_archive_sidecar_faults(recording: Recording, tmp_path: Path) -> None:
    write(recording, tmp_path / "a.csv")
    archive = bundle([tmp_path / "a.csv"], tmp_path / "test.zip")
    sidecar_path(archive).write_text('temperature_c = "warm"\n')
    (look,) = peek_test(archive)
    assert len(look.channels) == len(recording.channels)
    (problem,) = look.problems
    assert "test.toml" in problem
    assert "temperature_c = 'warm'" in problem
