"""The power is cut while files come in: nothing promised is lost, nothing is half written.

The long form is the benchmark `tests/benchmarks/power_cuts.py`.
"""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from tests.helpers.power import compiler
from tests.helpers.power_cuts import cut_at, record

CUTS, FILES, SEED = 30, 4, 20260501


def test_cuts_at_random_moments_lose_nothing_and_leave_nothing_half_written(
    tmp_path: Path,
) -> None:
    if compiler() is None:
        pytest.skip("POWER CUTS ARE NOT TESTED HERE: no C compiler (apt-get install gcc)")
    made, rng = record(tmp_path, FILES), random.Random(SEED)
    moments = made.moments
    assert len(moments) > 300, "the recorder did not see the ingest"
    chosen = sorted(rng.sample(moments, CUTS))
    cuts, went_on = cut_at(made, chosen, rng, every=10)
    assert cuts == CUTS
    assert went_on > 0
