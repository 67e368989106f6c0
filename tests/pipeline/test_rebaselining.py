"""A hanger is compared with itself anew: which tests, in which class, and what follows."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import timedelta
from typing import Any

import pytest

from shm.inference import UpdateOptions
from shm.models import Model
from shm.pipeline import rebaselining
from shm.pipeline.rebaselining import Order, changes_within, set_baseline
from shm.store import Baseline, Workspace
from shm.values import ModalTest, Posterior
from tests.helpers import quick_update
from tests.helpers.flows import ingest
from tests.helpers.workspaces import START, write_test

AT = START + timedelta(days=50)


@pytest.fixture
def hints(monkeypatch: pytest.MonkeyPatch) -> list[Posterior]:
    """The stand-in for the sampler; holds what it was told of where to look."""
    told: list[Posterior] = []

    def quick(
        tests: Sequence[ModalTest],
        model: Model,
        options: UpdateOptions,
        *_: Any,
        warm_start: Posterior,
    ) -> Posterior:
        told.append(warm_start)
        return quick_update.update(tests, model, options)

    monkeypatch.setattr(rebaselining, "update", quick)
    return told


@pytest.fixture
def history(workspace: Workspace) -> Workspace:
    """Two tests in the first days; in two a month later a tenth of the tension is gone."""
    for day, tension in ((0, 1.0), (1, 1.0), (31, 0.9), (32, 0.9)):
        spool(workspace, day, tension)
    ingest(workspace)
    return workspace


def spool(workspace: Workspace, day: int, tension: float) -> None:
    path = workspace.spool / f"t{day}.modes.json"
    write_test(path, workspace, day=day, tension=tension)


def anew(workspace: Workspace, day: float, hanger: int = 3) -> Baseline:
    order = Order(START + timedelta(days=day), "a new pin", "engineer")
    with workspace.store() as store:
        return set_baseline(workspace, store, workspace.bridge.hanger(hanger), order, AT).made


def test_the_tests_since_that_day_make_the_baseline(
    history: Workspace, hints: list[Posterior]
) -> None:
    made = anew(history, 31)
    assert made.posterior.tests == ("t31", "t32")
    assert made.posterior.model == "beam1"
    assert made.posterior.tension_n.mean() == pytest.approx(0.9 * 711e3, rel=0.01)
    assert (made.who, made.why, made.since, made.set_at) == (
        "engineer", "a new pin", START + timedelta(days=31), AT,
    )  # fmt: skip
    (warm_start,) = hints
    assert warm_start.tests == ("t0",)


def test_later_tests_are_compared_with_it_and_earlier_figures_stay(
    history: Workspace, hints: list[Posterior]
) -> None:
    with history.store() as store:
        before = store.watch.list_drifts(3)
    anew(history, 31)
    spool(history, 35, 0.9)
    ingest(history)
    with history.store() as store:
        after = store.watch.list_drifts(3)
        lately = [drift for drift in after if drift.test == "t35" and drift.quantity == "tension"]
    assert after[: len(before)] == before
    assert next(drift.shift_mean for drift in before if drift.test == "t32") < -0.08
    assert lately[0].shift_mean == pytest.approx(0, abs=0.01)


def test_a_baseline_over_a_called_change_is_known_as_such(
    history: Workspace, hints: list[Posterior]
) -> None:
    # What two tests have told is detected with a third, and more than one before it.
    for day, tension in ((10, 1.0), (20, 1.0), (61, 0.9), (91, 0.9)):
        spool(history, day, tension)
    ingest(history)
    with history.store() as store:
        (called,) = changes_within(store, 3, START)
        assert START + timedelta(days=1) <= called.began_after
        assert called.began_by <= START + timedelta(days=32)
        assert changes_within(store, 3, START + timedelta(days=31)) == ()
        assert changes_within(store, 4, START) == ()
