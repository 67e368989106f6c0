from __future__ import annotations

from pathlib import Path

import pytest

import shm.read
from shm.read import FORMATS, peek, sidecar_path
from shm.read.logger_words import accelerance_si, unit_of


@pytest.mark.parametrize(
    ("text", "quantity", "si"),
    [
        ("N", "force", 1.0),
        (" [kN] ", "force", 1000.0),
        ("lbf", "force", 4.4482216152605),
        ("m/s2", "acceleration", 1.0),
        ("m/s^2", "acceleration", 1.0),
        ("m/s**2", "acceleration", 1.0),
        ("m/s²", "acceleration", 1.0),
        ("m / s2", "acceleration", 1.0),
        ("mm/s²", "acceleration", 1e-3),
        ("g", "acceleration", 9.80665),
        ("mg", "acceleration", 9.80665e-3),
        ("µg", "acceleration", 9.80665e-6),
        ("μm/s²", "acceleration", 1e-6),
        ("um/s^2", "acceleration", 1e-6),
        ("cm/s2", "acceleration", 1e-2),
        ("m s^-2", "acceleration", 1.0),
        ("daN", "force", 10.0),
        ("kgf", "force", 9.80665),
        ("Newtons", "force", 1.0),
    ],
)
def test_a_unit_is_known_in_all_its_spellings(text: str, quantity: str, si: float) -> None:
    unit = unit_of(text)
    assert unit is not None
    assert (unit.quantity, unit.si) == (quantity, pytest.approx(si))


@pytest.mark.parametrize("text", ["", "V", "mV", "kg", "m/s", "Pa", "N/m", "EU", "gg"])
def test_any_other_unit_is_unknown(text: str) -> None:
    assert unit_of(text) is None


@pytest.mark.parametrize(
    ("above", "below", "factor"),
    [
        ("", "", 1.0),
        ("m/s2", "N", 1.0),
        ("g", "kN", 9.80665e-3),
        ("(m/s2)/N", "", 1.0),
        ("(m/s²)(N)", "", 1.0),
        ("g/N", "", 9.80665),
        ("mm", "N", None),
        ("N", "m/s2", None),
        ("m/s2", "V", None),
    ],
)
def test_accelerance_is_an_acceleration_over_a_force(
    above: str, below: str, factor: float | None
) -> None:
    found = accelerance_si(above, below)
    assert found == (None if factor is None else pytest.approx(factor))


def test_no_two_formats_claim_one_name_or_suffix() -> None:
    suffixes = [suffix for known in FORMATS for suffix in known.suffixes]
    names = [known.name for known in FORMATS]
    assert {each for each in suffixes if suffixes.count(each) > 1} == set()
    assert {each for each in names if names.count(each) > 1} == set()
    assert all(suffix.startswith(".") and suffix == suffix.lower() for suffix in suffixes)
    assert ".toml" not in suffixes


def test_all_formats_of_owners_are_registered() -> None:
    suffixes = {suffix for known in FORMATS for suffix in known.suffixes}
    assert suffixes >= {".csv", ".uff", ".h5", ".hdf5", ".mat", ".tdms", ".npz", ".npy", ".txt"}


def test_the_public_names_are_these() -> None:
    assert sorted(shm.read.__all__) == [
        "FORMATS", "Format", "Limits", "Peek", "PeekChannel", "bundle", "holds_test", "peek",
        "peek_test", "read", "read_test", "sidecar_path", "write",
    ]  # fmt: skip


def test_the_sidecar_stands_beside_the_file_whether_there_or_not() -> None:
    assert sidecar_path(Path("spool/h3.2026.csv")) == Path("spool/h3.2026.toml")
    assert sidecar_path(Path("h3.uff")) == Path("h3.toml")
    assert sidecar_path(Path("h3.2026.txt.gz")) == Path("h3.2026.toml")


def test_a_peek_says_si_where_the_name_alone_says_what_is_measured(tmp_path: Path) -> None:
    path = tmp_path / "test.csv"
    path.write_text("# sampling_rate_hz: 9\nforce,acc_1,thing\n" + "1,2,3\n" * 20)
    found = peek(path)
    assert [channel.unit for channel in found.channels] == ["N", "m/s2", ""]
    assert len(found.problems) == 1
    assert "channel thing" in found.problems[0]
