"""From the store to the charts of control hangers, and to the campaigns that they put in doubt."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from math import isfinite

from shm.report.control_report import campaign_warning
from shm.store import Store, Workspace
from shm.store.posteriors import list_trend
from shm.values import ControlHanger, Hanger
from shm.watch.control_chart import ControlChart, chart_control


def control_charts(workspace: Workspace, store: Store) -> tuple[ControlChart, ...]:
    """Chart all tests of every control hanger of the bridge.

    A tension that was read during a test, as of the bar's load cell, goes before the described.
    """
    return tuple(_chart(store, each) for each in workspace.bridge.controls)


def _chart(store: Store, control: ControlHanger) -> ControlChart:
    read = {each.id: each.test.tension_read_n for each in store.tests.list_all(control.id)}
    known = {id_: n if isfinite(n) else control.known_tension_n for id_, n in read.items()}
    trend = list_trend(store, control)
    of_tests = [
        (e.test, e.time, e.averaged.tension_n, e.averaged.repeatability_sd_n, known[e.test_id])
        for e in trend
    ]
    return chart_control(control, of_tests)


def campaign_warnings(
    charts: Sequence[ControlChart], hanger: Hanger, time: datetime | None, days: float
) -> tuple[str, ...]:
    """Return that a control hanger was out of its limits within `days` of a test; else nothing.

    Sensors that stay on a hanger have another logger than a campaign, and control hangers none.
    """
    if time is None or hanger.has_sensors or hanger.is_control:
        return ()
    found = ((chart, chart.out_near(time, days)) for chart in charts)
    return tuple(campaign_warning(hanger.id, chart, point) for chart, point in found if point)
