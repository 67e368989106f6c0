"""A workspace with years of tests of many hangers, filled within minutes.

One hanger is filled by the store's own verbs: posteriors of 1,000 samples, every fifth test from a
recording with its frequency response, watches with their shifts, alerts, a diagnosis. Its rows are
then copied for every other hanger within the database.
"""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import sqlalchemy as sa
from sqlalchemy.engine import Connection

from shm.models import build
from shm.read import write
from shm.simulate import HammerPlan, HangerState, hammer_test
from shm.store import Archive, IdentifiedTest, Lineage, Outcome, Store, Workspace
from shm.store.archive import Kept
from shm.store.columns import Document
from shm.store.tables import alerts, metadata, recordings, summaries
from shm.store.trends import key_of
from shm.values import (
    PLANES,
    Change,
    Drift,
    Hanger,
    ModalTest,
    Mode,
    Moved,
    Posterior,
    PredictedFrequency,
    QualityCheck,
    Selection,
    ShapePoint,
    WatchedTest,
)
from tests.helpers.diagnoses import a_diagnosis
from tests.helpers.nouns import a_file, a_response, an_alert
from tests.helpers.workspaces import START, make_workspace

LINEAGE = Lineage("0" * 64, "1" * 64, "0.1.0")
RECORDED_EVERY = 5
ALERTED = (0.3, 0.5, 0.7, 0.9)
CALLED = 0.95
SAMPLES, ORDERS, RESPONSE_LINES = 1000, 6, 3000
QUANTITIES = ("tension", "transverse_end_stiffness", "longitudinal_end_stiffness")
HOURS_APART = 12
_NOT_COPIED = ("tokens", "events")


def filled(folder: Path, hangers: int, tests: int) -> Workspace:
    """A workspace of so many hangers with so many tests each, in a SQLite file."""
    settings = {"models": "beam1,beam2", "samples": SAMPLES}
    workspace = make_workspace(folder, hangers=range(1, hangers + 1), settings=settings)
    first, *others = workspace.bridge.hangers
    with workspace.store() as store:
        _fill(store, workspace.archive, first, tests)
        store.posteriors.save_summaries(first)
        with store.reading() as connection:
            tables = [each for each in metadata.sorted_tables if each.name not in _NOT_COPIED]
            rooms = {table.name: _room(connection, table) for table in tables}
        for place, other in enumerate(others, start=1):
            with store.writing() as connection:
                for table in tables:
                    _copy(connection, table, rooms, place, other)
    return workspace


# ---------------------------------------------------------------- one hanger


def _fill(store: Store, archive: Archive, hanger: Hanger, tests: int) -> None:
    made = [_Made(hanger, number, tests) for number in range(tests)]
    raw = _raw(archive, hanger)
    for each in made:
        _take_in(store, each, raw)
    stored = dict(zip((each.name for each in made), store.tests.list_all(hanger.id), strict=True))
    first = stored[made[0].name]
    clamped = replace(made[0].posterior, model="beam1", log_evidence=-40.0)
    selection = Selection((made[0].posterior, clamped), (0.97, 0.03))
    store.posteriors.save_selection(hanger.id, [first], selection, LINEAGE, first.time)
    baseline = store.watch.baseline(hanger.id)
    assert baseline is not None
    for each in made[1:]:
        test = stored[each.name]
        store.posteriors.save(test, each.posterior, LINEAGE, test.time)
        alert = replace(an_alert(), key=f"{each.name} moved", hanger=hanger.id, test=each.name)
        is_alerted = any(abs(each.age - age) < 0.5 / tests for age in ALERTED)
        found = alert if is_alerted else None
        store.watch.save(test, baseline, each.watched, found, ["operator"], test.time)
    for raised in store.alerts.list_all(hanger.id)[:-1]:
        store.alerts.acknowledge(raised.id, "engineer", "looked at the pin", raised.raised_at)
    diagnosis = replace(a_diagnosis(), tests=(made[-1].name,))
    store.posteriors.save_diagnosis(hanger.id, diagnosis, LINEAGE, made[-1].time)


class _Made:
    """One test of a hanger whose tension swings with the year and falls at its end."""

    def __init__(self, hanger: Hanger, number: int, tests: int):
        self.hanger, self.age, self.name = hanger, number / tests, f"test-{number:05}"
        self.rng = np.random.default_rng([1, number])
        self.time: datetime = START + timedelta(hours=HOURS_APART * number)
        self.is_recorded = number % RECORDED_EVERY == 0
        self.is_call = CALLED < self.age <= CALLED + 1 / tests
        year = 2 * np.pi * HOURS_APART * number / 8766
        self.temperature_c = 10 + 12 * np.sin(year) + self.rng.normal()
        self.share = 1 - 0.01 * np.sin(year) - 0.06 * (self.age > CALLED)

    @property
    def test(self) -> ModalTest:
        shape = tuple(ShapePoint(1.2 + i, 0.3 * i, 0.01, 0.01) for i in range(4))
        modes = tuple(
            Mode(plane, order, 5.8 * order * np.sqrt(self.share), 0.006, 0.002, 0.0003, shape)
            for plane in PLANES
            for order in range(1, ORDERS + 1)
        )
        return ModalTest(self.name, modes, self.hanger.id, self.time, self.temperature_c, 1.0)

    @property
    def posterior(self) -> Posterior:
        model = build("beam2", self.hanger)
        centre = np.array([self.share, 0.98, 7.2, 7.4, 7.1, 7.3, 0.005])
        spread = np.array([0.01, 0.004, 0.2, 0.2, 0.2, 0.2, 0.001])
        predicted = tuple(
            PredictedFrequency(
                mode.plane, mode.order, mode.frequency_hz * 1.003, 0.02, mode.frequency_hz
            )
            for mode in self.test.modes
        )
        return Posterior(
            model=model.name,
            hanger=self.hanger.id,
            names=(*model.parameter_names, "sigma"),
            samples=self.rng.normal(centre, spread, (SAMPLES, len(centre))),
            log_likelihood=self.rng.normal(size=SAMPLES),
            most_probable=centre,
            nominal_tension_n=self.hanger.nominal_tension_n,
            log_evidence=-12.5,
            log_evidence_sd=0.1,
            effective_sample_size=840.0,
            r_hat=1.01,
            evaluations=9000,
            predicted=predicted,
            tests=(self.name,),
            seed=7,
            seconds=1.5,
            method="re-weighted",
        )

    @property
    def watched(self) -> WatchedTest:
        is_called = self.is_call
        began = START + timedelta(days=1)
        moved = Moved("tension", 0.9, self.share - 1, 0.004, alike=QUANTITIES[1:2])
        change = Change(
            350.0 if is_called else 1.0, 100.0, 0.9, 0.8, began, began, (moved,) * 3, 0.01
        )
        drifts = tuple(
            Drift(self.hanger.id, self.name, self.time, quantity, 711e3, 711e3 * self.share,
                  self.share - 1, 0.004, 0.05, 0.99 if is_called else 0.01)
            for quantity in QUANTITIES
        )  # fmt: skip
        return WatchedTest(self.name, self.time, self.temperature_c, drifts, change)


def _raw(archive: Archive, hanger: Hanger) -> Kept:
    """A recording as the logger writes it, which all recorded tests are said to come from."""
    state = HangerState(hanger.nominal_tension_n, 2e7, 2e7, 2e7, 2e7, damping_ratio=0.0015)
    plan = HammerPlan(hits=3, seconds_per_hit=8.0, acceleration_noise_m_s2=0.05)
    made = hammer_test(hanger, state, plan, np.random.default_rng(1), temperature_c=11.5)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "test.csv"
        write(made, path)
        return archive.keep(path)


def _take_in(store: Store, made: _Made, raw: Kept) -> None:
    number = int(made.name[-5:]) + 1
    file = a_file(number, file_name=f"{made.name}.modes.json", arrival=made.name)
    item = IdentifiedTest(made.test)
    if made.is_recorded:
        check = QualityCheck("double hits", "good", 0.0, 0.0, "", "no hit struck twice", "")
        response = a_response(lines=RESPONSE_LINES)
        item = replace(item, frequency_response=response, quality=(check,) * 8, notes=("a note",))
        file = replace(file, file_name=f"{made.name}.csv", archived_as=raw.archived_as)
    receipt = store.recordings.receive(file, made.time)
    assert receipt.outcome is Outcome.NEW
    store.tests.save(receipt.recording.id, [item], LINEAGE, made.time)


# ---------------------------------------------------------------- all others


def _copy(
    connection: Connection, table: sa.Table, rooms: dict[str, int], place: int, hanger: Hanger
) -> None:
    """Copies the rows of the first hanger; `rooms` holds the largest number of each table's."""
    names = ", ".join(f'"{column.name}"' for column in table.columns)
    chosen = ", ".join(_copied(column, rooms, place) for column in table.columns)
    statement = f"INSERT INTO {table.name} ({names}) SELECT {chosen} FROM {table.name}"
    statement += f" WHERE {_of_first(table, rooms)}"
    values = {"hanger": hanger.id, "text": f'"hanger": {hanger.id},', "key": key_of(hanger)}
    connection.execute(sa.text(statement), _used(values, statement))


def _room(connection: Connection, table: sa.Table) -> int:
    if "id" not in table.c:
        return 0
    return int(connection.scalar(sa.select(sa.func.max(table.c.id))) or 0)


def _of_first(table: sa.Table, rooms: dict[str, int]) -> str:
    """Which rows are of the first hanger: by their own numbers, or those they refer to."""
    if "id" in table.c:
        return f"id <= {rooms[table.name]}"
    column = next(column for column in table.columns if column.foreign_keys)
    (key,) = column.foreign_keys
    return f"{column.name} <= {rooms[key.column.table.name]}"


def _copied(column: sa.Column[Any], rooms: dict[str, int], place: int) -> str:
    name = f'"{column.name}"'
    for key in column.foreign_keys:
        return f"{name} + {place * rooms[key.column.table.name]}"
    if column.name == "id":
        return f"{name} + {place * rooms[column.table.name]}"
    if column is recordings.c.sha256:
        return f"'{place:08x}' || substr({name}, 9)"
    if column is alerts.c.key:
        return f"{name} || ' {place}'"
    if column is summaries.c.key:
        return ":key"
    if column.name == "hanger":
        return ":hanger"
    if isinstance(column.type, Document):
        return f"""replace({name}, '"hanger": 1,', :text)"""
    return name


def _used(values: dict[str, Any], statement: str) -> dict[str, Any]:
    return {name: value for name, value in values.items() if f":{name}" in statement}
