"""Where a sidecar stands, beside names of every length."""

from __future__ import annotations

from pathlib import Path

import pytest

from shm.read import sidecar_path


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("h3.csv", "h3.toml"),
        ("h3.csv.gz", "h3.toml"),
        ("h3.modes.json", "h3.modes.toml"),
        ("x" * 250 + ".csv", "x" * 250 + ".toml"),
        ("x" * 251 + ".csv", "x" * 250 + ".toml"),
        ("x" * 248 + ".csv.gz", "x" * 248 + ".toml"),
    ],
)
def test_it_has_the_name_of_the_file_cut_to_what_a_folder_takes(name: str, expected: str) -> None:
    assert sidecar_path(Path("spool", name)) == Path("spool", expected)
