"""From the store to the charts of control hangers, and to the campaigns that they put in doubt."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from math import isfinite

from shm.report.control_report import campaign_warning
from shm.store import Store, Workspace
from shm.values import NAN, ControlHanger, ModalTest
from shm.watch.control_chart import ControlChart, ControlReading, chart_control


def without_reading(test: ModalTest) -> ModalTest:
    """Return a test of a control hanger to infer its tension from: what was read must not help."""
    return replace(test, tension_read_n=NAN, tension_read_sd_n=NAN)


def control_charts(
    workspace: Workspace, store: Store, controls: Sequence[ControlHanger] = ()
) -> tuple[ControlChart, ...]:
    """Chart all tests of `controls`, else of every control hanger of the bridge.

    A tension that the load cell of the bar showed during a test goes before the described one.
    """
    return tuple(_chart(store, each) for each in controls or workspace.bridge.controls)


def _chart(store: Store, control: ControlHanger) -> ControlChart:
    read = {each.id: each.test.tension_read_n for each in store.tests.list_all(control.id)}
    readings = []
    for point in store.posteriors.trend(control):
        averaged, known_n = point.averaged, read.get(point.test_id, NAN)
        tension_n, repeats_n = averaged.tension_n, averaged.repeatability_sd_n
        if not (isfinite(known_n) and known_n > 0):
            known_n = control.known_tension_n
        readings.append(
            ControlReading(point.test, point.time, tension_n.mean, tension_n.sd, repeats_n, known_n)
        )
    return chart_control(control, readings)


def campaign_warnings(
    charts: Sequence[ControlChart], hanger: int, time: datetime | None, days: float
) -> tuple[str, ...]:
    """Return that a control hanger was out of its limits within `days` of a test; else nothing."""
    if time is None:
        return ()
    found = ((chart, chart.out_near(time, days)) for chart in charts)
    return tuple(campaign_warning(hanger, chart, point) for chart, point in found if point)
