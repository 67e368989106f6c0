"""Two tests of a loss tell of it whatever their clock says; `tests/benchmarks` counts more."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.helpers.clock_faults import FAULTS, one_case
from tests.helpers.slow import few_of


@pytest.mark.parametrize("fault", few_of(FAULTS, 3))
def test_a_loss_is_told_of_by_its_second_test(fault: str, tmp_path: Path) -> None:
    found = one_case(fault, 1000, tmp_path)
    assert found.told
    assert not found.good_held
