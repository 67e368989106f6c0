"""The state of a watch that is kept between two tests, and what makes it void."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from shm.errors import BadInput
from shm.watch.engine.change_point import RAMP, STEP, evidence_of
from shm.watch.engine.kept_state import from_bytes, to_bytes
from shm.watch.engine.options import WatchOptions
from shm.watch.state_sums import WatchState, detected_change
from shm.watch.watcher import Watcher
from tests.helpers.hangers import HANGER_3
from tests.helpers.synthetic_readings import (
    PLANES_ALONE,
    History,
    columns,
    watcher,
)

OPTIONS = WatchOptions(baseline_tests=4)
WATCHER = watcher(PLANES_ALONE, OPTIONS)


def test_the_key_goes_with_options_and_quantities_but_not_with_thresholds() -> None:
    tension, *others = PLANES_ALONE
    limits = replace(HANGER_3.thresholds, tension_shift_fraction=0.1)
    watchers = [
        WATCHER,
        watcher(PLANES_ALONE, replace(OPTIONS, limit_years=20)),
        watcher((tension,), OPTIONS),
        watcher((replace(tension, values=tension.values * 2), *others), OPTIONS),
    ]

    for one, other in itertools.combinations(watchers, 2):
        assert one.key != other.key
    stricter = Watcher(
        PLANES_ALONE, columns(len(PLANES_ALONE)), replace(HANGER_3, thresholds=limits), OPTIONS
    )
    assert stricter.key == WATCHER.key


def test_a_state_cut_short_is_refused() -> None:
    state, _ = WATCHER.begin(History(PLANES_ALONE, 4).readings(3))
    content = to_bytes(state)

    with pytest.raises(BadInput, match="cannot be read"):
        from_bytes(WatchState, content[: len(content) // 2])


def test_a_called_step_begins_where_a_step_is_likeliest_and_not_where_a_ramp_is() -> None:
    state, watch = WATCHER.begin(History(PLANES_ALONE, 8, outliers=0).readings(3))
    rows, structure = np.arange(8), WATCHER.structure
    sums = WATCHER.sums.sums(state, rows)
    evidence = evidence_of(sums, state.years, 1, structure.layout, structure.directions)
    log_mass = np.full_like(evidence.log_mass, -math.inf)
    # The likeliest of all is a ramp from test 3 on; likelier together are steps at tests 4 and 5.
    for at, kind, share in ((2, RAMP, 0.43), (3, STEP, 0.2), (4, STEP, 0.37)):
        log_mass[at, 0, kind, 0, 0] = math.log(share)

    leading = replace(evidence, log_mass=log_mass)
    for sudden, is_ramp, first in ((0.57, False, 5), (0.43, True, 3)):
        change = replace(watch.tests[-1].change, sudden=sudden)
        found = detected_change(leading, rows, change)
        assert (found.is_ramp, found.first) == (is_ramp, first)
        assert found.years == state.years[first - 1]
