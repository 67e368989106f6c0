"""What loggers wrote, what was identified before, and a hanger as its owner describes it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TypeAlias

from shm import bridge
from shm.bridge.hanger import hanger_of
from shm.identify import Identification
from shm.read import read as read_file
from shm.read import whole_test
from shm.values import FrequencyResponse, Hanger, ModalTest, Recording


def read(path: str | Path) -> Recording | FrequencyResponse:
    """The content of one file, in SI units, gaps as NaN.

    CSV, UFF58, HDF5, MATLAB, TDMS, miniSEED or npz; a sidecar NAME.toml beside NAME.csv says what
    the file does not. Time histories are a Recording, frequency responses a FrequencyResponse.
    Raises BadInput naming file, line, channel and remedy. A .zip holds several files of one test:
    `shm.read.read_test` gives them all.

    Example:
        >>> recording = shm.read("hanger3.csv")
        >>> [channel.name for channel in recording.channels]
        ['force', 'acc_1', 'acc_2']
    """
    return read_file(Path(path))


def load_modes(path: str | Path) -> tuple[ModalTest, ...]:
    """The modal tests of a `*.modes.json` document, as `shm identify --out` writes it.

    One test each, modes in Hz by plane and order. A sidecar NAME.modes.toml may say hanger, time
    and temperature. Raises BadInput naming test, mode and remedy.

    Example:
        >>> tests = shm.load_modes("hanger3.modes.json")
        >>> tests[0].modes[0].frequency_hz
        5.82
    """
    return whole_test.load_modes(Path(path))


Test: TypeAlias = ModalTest | Identification
Tests: TypeAlias = Test | Sequence[Test]
"""What `update`, `select` and `diagnose` take."""


def modal_tests(tests: Tests) -> tuple[ModalTest, ...]:
    """The modal tests, one or many."""
    given = (tests,) if isinstance(tests, ModalTest | Identification) else tests
    return tuple(each.test if isinstance(each, Identification) else each for each in given)


def load_hanger(path: str | Path, hanger_id: int | None = None) -> Hanger:
    """A hanger described in a TOML file: a `bridge.toml`, or a file with one `[[hanger]]` table.

    `hanger_id` says which, and may be left out where the file has one only. Raises BadInput naming
    the table and key at fault, or the hangers that there are.

    Example:
        >>> hanger = shm.load_hanger("bridge.toml", 3)
        >>> hanger.length_m
        12.0
    """
    return bridge.load_hanger(Path(path), hanger_id)


def round_bar(
    id: int,
    *,
    diameter_m: float,
    length_m: float,
    elastic_modulus_pa: float,
    density_kg_m3: float,
    nominal_tension_n: float,
    name: str = "",
) -> Hanger:
    """A solid round bar, clamped at both ends: section and mass follow from diameter and density.

    The same checks are made as of a `[[hanger]]` table, which can say more (end plates,
    turnbuckles, strands, supports). A nominal tension of 0 is a bar without any. Raises BadInput
    naming the figure that cannot be.

    Example:
        >>> hanger = shm.round_bar(
        ...     3, diameter_m=0.130, length_m=12.0, elastic_modulus_pa=200e9,
        ...     density_kg_m3=7800, nominal_tension_n=711e3,
        ... )
        >>> round(hanger.mass_per_length_kg_m, 1)
        103.5
    """
    values = {
        "id": id,
        "diameter_m": diameter_m,
        "length_m": length_m,
        "elastic_modulus_pa": elastic_modulus_pa,
        "density_kg_m3": density_kg_m3,
        "nominal_tension_n": nominal_tension_n,
        "name": name,
    }
    return hanger_of(values, Path())
