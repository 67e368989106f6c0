"""The disk fills while files come in: nothing is lost or half written, and the work goes on after.

The long form is the benchmark `tests/benchmarks/full_disk.py`.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.helpers.full_disks import fill_at_calls
from tests.helpers.power import compiler


@pytest.mark.slow
def test_a_disk_that_fills_at_any_call_costs_nothing(tmp_path: Path) -> None:
    if compiler() is None:
        pytest.skip("A FULL DISK IS NOT TESTED HERE: no C compiler (apt-get install gcc)")
    said = fill_at_calls(tmp_path, files=4, every=120)
    assert "0 lost, 0 half written" in said
