"""A tension beyond the owner's limit raises one alert a crossing, which ends when it is back."""

from __future__ import annotations

from shm.pipeline.bridge_reporting import hanger_summaries
from shm.report.hanger_status import Status
from shm.store import StoredAlert, Workspace
from tests.helpers.flows import Clock, Postman, a_flow, receive_all
from tests.helpers.workspaces import write_test

LOWER, UPPER = "hanger.3.limits.tension_min_n", "hanger.3.limits.tension_max_n"


def after(
    workspace: Workspace, tension: float = 0.0, postman: Postman | None = None, **limits: float
) -> list[StoredAlert]:
    """Alerts of limits after another test, or a limit that is changed, and all work is done."""
    workspace = workspace.reopened()
    with a_flow(workspace, clock=Clock(), notifier=postman) as flow:
        for name, value in limits.items():
            key = {"lower": LOWER, "upper": UPPER}[name]
            workspace.change_setting(flow.store, key, value, flow.clock(), "Meier")
            flow.use(workspace.reopened())
        if tension:
            day = len(flow.store.tests.list_all(3))
            path = workspace.spool / f"t{day}.modes.json"
            write_test(path, workspace, day=20 * day, tension=tension)
            receive_all(flow)
        flow.drain()
        return [each for each in flow.store.alerts.list_all() if each.alert.kinds == ("limit",)]


def test_a_crossed_limit_is_told_once_and_ends_when_the_tension_is_back(
    workspace: Workspace,
) -> None:
    postman = Postman()
    assert after(workspace, lower=600e3) == []
    assert after(workspace, 1.0) == []  # 711 kN
    (one,) = after(workspace, 0.7, postman)
    assert "is below its lower limit. Repeat the hammer test today" in one.alert.message
    assert "limit of 600 kN" in one.alert.message
    assert ("mail", one.alert.key) in postman.told
    assert len(after(workspace, 0.7)) == 1
    (one,) = after(workspace, 1.0)
    assert one.resolution is not None
    assert "within the limit" in one.resolution.why
    _, two = after(workspace, 0.7)
    assert two.resolution is None
    with workspace.store() as store:
        (line,) = hanger_summaries(workspace.reopened(), store, Clock()())
    assert "below its lower limit" in two.alert.message
    assert line.message.status is not Status.STEADY


def test_a_limit_that_is_changed_judges_at_once_and_what_a_person_resolved_stays_so(
    workspace: Workspace,
) -> None:
    after(workspace, 1.0)
    (one,) = after(workspace, upper=650e3)
    assert "above its upper limit" in one.alert.message
    with workspace.reopened().store() as store:
        (line,) = hanger_summaries(workspace.reopened(), store, Clock()())
        assert line.message.status is Status.CHECK
        assert one.alert.message.startswith(line.message.lead.words)
        store.alerts.resolve(one.id, "Meier", "load test", Clock()())
    assert len(after(workspace, 1.0)) == 1
    assert len(after(workspace, upper=800e3)) == 1
    assert len(after(workspace, upper=640e3)) == 2
    _, two = after(workspace, upper=800e3)
    assert two.resolution is not None
    assert two.resolution.why == "the limit has been changed"
