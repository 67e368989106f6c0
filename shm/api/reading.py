"""What loggers wrote, and what was identified before."""

from __future__ import annotations

from pathlib import Path

from shm.read import modes_file
from shm.read import read as read_file
from shm.values import FrequencyResponse, ModalTest, Recording


def read(path: str | Path) -> Recording | FrequencyResponse:
    """The content of one file, in SI units, gaps as NaN.

    CSV, UFF58, HDF5, MATLAB, TDMS or npz; a sidecar NAME.toml beside NAME.csv says what the file
    does not. Time histories are a Recording, frequency responses a FrequencyResponse. Raises
    BadInput naming file, line, channel and remedy. A .zip holds several files of one test:
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
    return modes_file.load_modes(Path(path))
