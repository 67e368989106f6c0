"""Frequency responses as text, ours and as analysers export them; text that is gzipped."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

from shm.errors import BadInput
from shm.read import peek, read, sidecar_path, write
from shm.values import FrequencyResponse, Recording
from tests.helpers.written import recorded, refused, responded

LINES = 40
VALUES = np.arange(LINES) - 1j * np.arange(LINES)[::-1]
NAMES = "frequency,low_real,low_imaginary,high_real,high_imaginary"
ANALYSER = (
    "Units: Ratio\r\nRef Chan:Resp Chan\t0-Z:0-Z\r\nChannel Name\t : \r\n\r\n"
    "Frequency\t Real\t Imaginary\t\r\n\r\nUnits:\r\nHz\t(m/s²)(N)\t \r\n"
)


def rows(columns: int = 2, step: float = 0.5, first: float = 0.0, mark: str = ",") -> str:
    lines = []
    for i, value in enumerate(VALUES):
        cells = [first + step * i, *[value.real, value.imag] * (columns // 2)]
        lines.append(mark.join(repr(float(cell)) for cell in cells))
    return "\n".join(lines) + "\n"


def response_in(path: Path, text: str) -> FrequencyResponse:
    path.write_bytes(text.encode("latin-1"))
    return responded(path)


def test_an_analysers_export_is_read_through_its_free_lines(tmp_path: Path) -> None:
    path = tmp_path / "H1.txt"
    sidecar_path(path).write_text('hanger = 3\nx_m = 0.25\nplane = "transverse"\n')
    found = response_in(path, ANALYSER + rows(mark="\t"))
    (point,) = found.points
    assert (point.name, point.x_m, point.plane, found.hanger) == ("point_1", 0.25, "transverse", 3)
    np.testing.assert_allclose(found.accelerance, [VALUES])
    np.testing.assert_allclose(found.frequency_hz, 0.5 * np.arange(LINES))
    look = peek(path)
    assert (look.lines, look.frequency_step_hz, look.samples) == (LINES, 0.5, 0)
    assert look.channels[0].unit == "(m/s²)(N)"


@pytest.mark.parametrize(
    ("names", "points"),
    [
        (NAMES, ["low", "high"]),
        ("Freq (Hz); low Re; low Im; high Re; high Im", ["low", "high"]),
        ('"Frequency","Real","Imag","Real part","Imaginary part"', ["point_1", "point_2"]),
        ("frequency\tReal [g/N]\tImag [g/N]\tacc_2.real\tacc_2.imag", ["point_1", "acc_2"]),
    ],
)
def test_pairs_of_columns_are_points(tmp_path: Path, names: str, points: list[str]) -> None:
    mark = next(m for m in "\t;," if m in names)
    text = f"{names}\n{rows(columns=4, mark=mark)}"
    found = response_in(tmp_path / "test.csv", text)
    assert [point.name for point in found.points] == points
    np.testing.assert_allclose(found.accelerance, [VALUES, VALUES])


def test_header_lines_and_units_count_as_in_other_csv_files(tmp_path: Path) -> None:
    head = "# hanger: 7\n# x_m: 2.5, 4\n# plane: , longitudinal\n# unit: g/N, m/s2/kN\n"
    found = response_in(tmp_path / "test.csv", f"{head}{NAMES}\n{rows(4)}")
    assert [(p.plane, p.x_m) for p in found.points] == [(None, 2.5), ("longitudinal", 4.0)]
    np.testing.assert_allclose(found.accelerance, [9.80665 * VALUES, 1e-3 * VALUES])


def test_decimal_commas_and_a_first_line_above_zero_are_understood(tmp_path: Path) -> None:
    text = "Frequenz;Re;Im\n" + rows(mark=";", first=2.0).replace(".", ",")
    found = response_in(tmp_path / "test.txt", text)
    assert found.frequency_hz[0] == 0
    assert np.isnan(found.accelerance[0, :4]).all()
    np.testing.assert_allclose(found.accelerance[0, 4:], VALUES)


def test_rounded_frequencies_lie_on_the_grid_that_they_mean(tmp_path: Path) -> None:
    listed = "".join(f"{i * 0.01953125:.3f},1,2\n" for i in range(1, 500))
    found = response_in(tmp_path / "test.csv", f"frequency,real,imaginary\n{listed}")
    assert len(found.frequency_hz) == 500
    assert found.frequency_hz[1] == pytest.approx(0.01953125, rel=1e-4)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (f"frequency,magnitude,phase\n{rows()}", "'magnitude' is no part of a response"),
        (f"frequency,a_real,a_imag,a_re\n{rows(4)}", "'a_re' occurs twice"),
        (f"frequency,a_real,b_imaginary\n{rows()}", "a real or an imaginary part is missing"),
        (f"frequency,real,imaginary\n{rows()}0.3,1,2\n", "even grid"),
        (f"frequency,real,imaginary\n{rows(step=-1.0)}", "even grid"),
        (f"frequency,real,imaginary\n{rows(first=0.2)}", "even grid"),
        (f"frequency,real,imaginary\n{rows(first=-5.0)}", "even grid"),
        ("frequency,real,imaginary\n0,1,2\n1,2,3\n", "2 lines; at least 16"),
        ("frequency,real,imaginary\n", "0 lines"),
        (f"frequency,real,imaginary\n{rows()}oops,1,2\n", "'oops' is not a number"),
        (f"# unit: m/s2\nfrequency,real,imaginary\n{rows()}", "not one of acceleration over"),
        (f"# unit: mm/N\nfrequency,real,imaginary\n{rows()}", "not one of acceleration over"),
        (f"frequency,real,imaginary\n{rows().replace(',5.0,', ',4e12,')}", "which no sensor gives"),
        ("frequency,real,imaginary,coherence\n" + rows(4).replace("0.0,", "7,"), "twice|values"),
    ],
)
def test_what_cannot_be_used_is_refused_with_a_remedy(
    tmp_path: Path, text: str, words: str
) -> None:
    with pytest.raises(BadInput, match=words) as refusal:
        response_in(tmp_path / "test.csv", text)
    assert refusal.value.remedy


def test_a_coherence_that_is_none_is_refused(tmp_path: Path) -> None:
    listed = "".join(f"{i},1,2,{0.9 if i else 57}\n" for i in range(LINES))
    with pytest.raises(BadInput, match="a coherence lies far outside"):
        response_in(tmp_path / "test.csv", f"frequency,real,imaginary,coherence\n{listed}")


def test_a_point_can_be_left_out(response: FrequencyResponse, tmp_path: Path) -> None:
    for suffix in (".csv", ".uff", ".npz"):
        path = tmp_path / f"test{suffix}"
        write(response, path)
        with sidecar_path(path).open("w") as sidecar:
            sidecar.write("[channel.low]\nleave_out = true\n")
        found = responded(path)
        assert [point.name for point in found.points] == ["high"]
        np.testing.assert_allclose(found.accelerance, response.accelerance[1:], rtol=1e-9)


# ---------------------------------------------------------------- gzip


@pytest.mark.parametrize("suffix", [".csv", ".txt", ".uff"])
def test_gzipped_text_is_read_with_the_sidecar_of_its_plain_name(
    recording: Recording, tmp_path: Path, suffix: str
) -> None:
    plain = tmp_path / f"test{suffix}"
    write(recording, plain)
    packed = tmp_path / f"test{suffix}.gz"
    packed.write_bytes(gzip.compress(plain.read_bytes()))
    plain.unlink()
    sidecar_path(plain).write_text("hanger = 11\n")
    found = recorded(packed)
    assert (found.hanger, found.source) == (11, str(packed))
    np.testing.assert_allclose(found.channels[0].values, recording.channels[0].values)
    assert peek(packed).problems == ()


def packed(content: bytes) -> bytes:
    """Return the same bytes at any time of the day, so that the test has one name."""
    return gzip.compress(content, mtime=0)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("test.csv.gz", b"force,acc_1\n1,2\n", "cannot be unpacked"),
        ("test.csv.gz", packed(b"force,acc_1\n" * 900)[:-20], "cannot be unpacked"),
        ("test.csv.gz", packed(b""), "empty"),
        ("test.h5.gz", packed(b"\x89HDF\r\n\x1a\n"), "suffix .gz belongs to no format"),
        ("test.gz", packed(b"force,acc_1\n"), "suffix .gz belongs to no format"),
        ("test.csv.gz", packed(b"\x89PNG\r\n\x1a\n" + bytes(50)), "PNG picture"),
        ("test.csv", packed(b"force,acc_1\n"), "gzip archive"),
    ],
)
def test_gzipped_files_that_cannot_be_used_are_refused(
    tmp_path: Path, name: str, content: bytes, words: str
) -> None:
    (tmp_path / name).write_bytes(content)
    refused(tmp_path / name, words, read, peek)
