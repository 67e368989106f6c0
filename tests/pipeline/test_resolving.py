"""Conditions that end, and planned works, through the whole flow with the sampler's stand-in."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import pytest

from shm.pipeline import utc_now
from shm.pipeline.bridge_reporting import hanger_summaries
from shm.pipeline.reconcile import SHM, Condition, reconcile
from shm.report.hanger_status import Status, hanger_message
from shm.store import StoredAlert, Workspace
from shm.store.rows import Ending
from shm.values.messages import Lead
from tests.helpers import quick_update
from tests.helpers.flows import Clock, Postman, a_flow, receive_all
from tests.helpers.nouns import NOW, an_alert
from tests.helpers.slow import few_of
from tests.helpers.workspaces import START, make_workspace, write_test


@pytest.fixture
def bridge(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Workspace:
    quick_update.stand_in(monkeypatch.setattr)
    return make_workspace(tmp_path / "bridge", hooks={"mail": ["true"]})


def take(workspace: Workspace, postman: Postman, day: float, tension: float) -> None:
    path = workspace.spool / f"d{day:g}.modes.json"
    write_test(path, workspace, day=day, tension=tension)
    clock = Clock(START + timedelta(days=day, hours=1))
    with a_flow(workspace, clock=clock, notifier=postman) as flow:
        receive_all(flow)
        flow.drain()
        flow.drain()


def test_a_tension_that_comes_back_resolves_its_alert(bridge: Workspace) -> None:
    postman = Postman()
    for day, tension in ((0, 1.0), (59, 0.8), (60, 0.8)):
        take(bridge, postman, day, tension)
    # The first asks to repeat the test that fits none before it.
    (raised,) = {key for _, key in postman.told if "repeat-the-test" not in key}
    for day in (90, 120, 150):
        take(bridge, postman, day, 1.0)
    assert ("mail", f"{raised}:resolved") in postman.told
    with bridge.store() as store:
        (found,) = (each for each in store.alerts.list_all() if each.alert.key == raised)
        assert found.resolution is not None
        assert found.resolution.who == "shm"


def test_the_same_conditions_again_change_nothing_and_one_that_is_over_closes_its_alert() -> None:
    told = StoredAlert(7, replace(an_alert("a"), kinds=("gap",)), NOW)
    holds = Condition(replace(an_alert("b"), kinds=("limit",)), "holds")
    first = reconcile([told], [Condition(told.alert, "unknown"), holds, holds])
    assert ([each.key for each in first.to_open], first.to_close) == (["b"], {})
    opened = StoredAlert(8, holds.alert, NOW)
    again = reconcile([told, opened], [Condition(told.alert, "over", "gone"), holds])
    assert (again.to_open, again.to_close) == ((), {7: (Ending.OVER, "gone")})
    # A condition that comes back once its alert is closed is another alert.
    assert reconcile([told], [holds]).to_open == (holds.alert,)


RAMP = (
    (0, 1.0),
    (30, 1.0),
    (60, 1.0),
    (90, 1.0),
    (120, 0.96),
    (150, 0.92),
    (180, 0.92),
    (210, 0.92),
)


@pytest.mark.slow
def test_one_disturbed_visit_does_not_end_the_alert_of_a_loss_that_stands(
    bridge: Workspace,
) -> None:
    postman = Postman()
    for day, tension in RAMP:
        take(bridge, postman, day, tension)
    (raised,) = {key for _, key in postman.told}
    # Two tests of one visit, as with a van on the deck: the watch takes the loss for gone.
    for day in (240, 241):
        take(bridge, postman, day, 1.0)
    with bridge.store() as store:
        disturbed = store.watch.list_all(3)[-1].watched
        tension = next(each for each in disturbed.drifts if each.quantity == "tension")
        assert tension.probability < bridge.bridge.hangers[0].thresholds.end_probability
    for day in (270, 300):
        take(bridge, postman, day, 0.92)
    with bridge.store() as store:
        (found,) = (each for each in store.alerts.list_all() if each.alert.key == raised)
    assert found.resolution is None
    assert ("mail", f"{raised}:resolved") not in postman.told


@pytest.mark.parametrize(("tension", "who"), few_of([(0.92, SHM), (0.96, "Ann")], 1))
def test_a_resolved_alert_whose_change_two_visits_show_again_rings_anew(
    bridge: Workspace, tension: float, who: str
) -> None:
    # Below its threshold, too: a change that was called is known to the watch from then on.
    postman = Postman()
    days = (0, 30, 60, 90, 120, 150, 180)
    for day in days:
        take(bridge, postman, day, 1.0 if day < 120 else tension)
    with bridge.store() as store:
        raised = store.alerts.list_all()[-1]
        assert "sudden change" in raised.alert.kinds
        store.alerts.resolve(raised.id, who, "a new pin", START + timedelta(days=185))
    take(bridge, postman, 210, tension)
    anew = f"{raised.alert.key}:again-{raised.id}"
    assert ("mail", anew) not in postman.told, "one visit rings nothing"
    for day in (240, 270, 300):
        take(bridge, postman, day, tension)
    assert postman.told.count(("mail", anew)) == 1, "once"
    with bridge.store() as store:
        (again,) = (each for each in store.alerts.list_all() if each.alert.key == anew)
    assert again.resolution is None
    assert again.alert.kinds == raised.alert.kinds
    assert f"Alert {raised.id}, which reported it, was resolved on" in again.alert.message
    assert "of two visits, show it again" in again.alert.message


def test_alerts_of_a_loss_that_was_restored_report_what_holds(bridge: Workspace) -> None:
    """No alert of the return asks to decide on traffic, as it did by the shift reported before."""
    postman = Postman()
    for day in range(0, 300, 30):
        take(bridge, postman, day, 0.84 if 120 <= day < 210 else 1.0)
        with bridge.store() as store:
            alerts = [each for each in store.alerts.list_all() if each.resolution is None]
            (state,) = hanger_summaries(bridge, store, utc_now())
        if day == 180:
            (lost,) = alerts  # it answers the notice on the first test that showed the loss
            assert "beyond threshold" in lost.alert.kinds
            assert Lead.of(lost.alert.message).urgency == hanger_message(state).urgency == "today"
    (back,) = alerts
    assert back.alert.kinds == ("sudden change",)
    assert "tension rose by" in back.alert.message
    assert "beyond its threshold" not in back.alert.message
    assert Lead.of(back.alert.message).urgency == hanger_message(state).urgency == "week"


def test_that_a_test_is_to_be_repeated_ends_with_one_that_does_not_show_the_same(
    bridge: Workspace,
) -> None:
    postman = Postman()
    for day, tension in ((0, 1.0), (30, 0.8), (60, 0.8)):
        take(bridge, postman, day, tension)
    with bridge.store() as store:
        (notice,) = store.alerts.list_all()
        assert notice.alert.kinds == ("repeat the test",)
        assert notice.resolution is None, "the repeated test shows what the first has shown"
        assert hanger_summaries(bridge, store, utc_now())[0].status is Status.WATCH
    for day in (65, 90):
        take(bridge, postman, day, 1.0)
    with bridge.store() as store:
        assert store.alerts.list_all()[0].resolution is not None
        assert hanger_summaries(bridge, store, utc_now())[0].status is Status.STEADY
