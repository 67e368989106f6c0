"""A key that is misspelt is refused with the nearest one that is known."""

from __future__ import annotations

from pathlib import Path

import pytest

import shm
from shm.errors import BadInput


@pytest.mark.parametrize(
    ("key", "begins"),
    [("diametre_m", "Did you mean diameter_m? Known: "), ("zzz", "Known: ")],
)
def test_refuse_unknown(tmp_path: Path, key: str, begins: str) -> None:
    path = tmp_path / "hanger.toml"
    path.write_text(f"[[hanger]]\nid = 1\n{key} = 0.08\n")
    with pytest.raises(BadInput, match=f"unknown key {key}") as refused:
        shm.load_hanger(path)
    assert str(refused.value.remedy).startswith(begins)
