"""The tests of a hanger as lines of a table, in the words of the report."""

from __future__ import annotations

import math
from dataclasses import dataclass

from shm.report import formatting
from shm.report.formatting import Interval
from shm.store import TestRow, TrendPoint
from shm.values.rounding import ForceUnit
from shm_daemon.web.address import test_page
from shm_daemon.web.hanger_figures.over_time import tension_unit
from shm_daemon.web.hanger_view import HangerView


@dataclass(frozen=True)
class TestLine:
    """One test, its tension in `unit`; `point` is None before it has been through updating."""

    __test__ = False  # no test, though named so

    row: TestRow
    point: TrendPoint | None
    unit: ForceUnit

    @property
    def id(self) -> int:
        return self.row.id

    @property
    def name(self) -> str:
        return self.row.name

    @property
    def address(self) -> str:
        return test_page(self.row.hanger, self.row.name)

    @property
    def time(self) -> str:
        """Its own or, where it tells none, that of its receipt."""
        received = self.point is not None and self.point.taken_at is None
        return formatting.moment(self.row.time) + (" (received)" if received else "")

    @property
    def cells(self) -> tuple[str, str, str, str]:
        """Temperature, model, tension and its interval."""
        if self.point is None:
            return ("", f"on its way: {self.row.stage.value}", "", "")
        tension = Interval.of_averaged(self.point.averaged).in_unit(self.unit)
        known = math.isfinite(self.point.temperature_c)
        return (
            formatting.temperature(self.point.temperature_c) if known else "not recorded",
            formatting.model_class(self.point.model),
            formatting.mean(tension),
            formatting.span(tension),
        )


def headings(view: HangerView) -> tuple[str, ...]:
    """Of the table of the lines."""
    unit = tension_unit(view.trend)
    return ("test", "time", "temperature", "model", *formatting.tension_headings(unit))


def lines_before(view: HangerView, limit: int, before: int | None = None) -> list[TestLine]:
    """So many tests, the newest first; `before` is the number of the test to go on after."""
    points = {point.test_id: point for point in view.trend}
    rows = view.store.tests.list_rows(view.hanger.id, limit, before)
    unit = tension_unit(view.trend)
    return [TestLine(row, points.get(row.id), unit) for row in rows]
