"""Forces whose squares are no numbers of double precision."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from shm.errors import BadInput
from shm.identify import identify
from shm.read import read
from shm.values import Recording
from tests.helpers.logger_exports import write_described_export


@pytest.mark.parametrize("factor", [1e-320, 1e-200])
def test_identify_refuses_underflowing_force(tmp_path: Path, factor: float) -> None:
    record = read(write_described_export(tmp_path / "a.csv", "2025-05-14 09:12:31"))
    assert isinstance(record, Recording)
    channels = tuple(
        replace(each, values=each.values * factor) if each.quantity == "force" else each
        for each in record.channels
    )
    with pytest.raises(BadInput, match="that is no hit"):
        identify([replace(record, channels=channels)], test_id="a")
