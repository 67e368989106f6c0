"""A workspace with years of tests of many hangers, filled within minutes.

One hanger is filled by the store's own verbs: posteriors of 1,000 samples, every fifth test from a
recording with its frequency response, watches with their shifts, alerts, a diagnosis, notes. Its
rows are then copied for every other hanger within the database. Some hangers have a permanent
sensor with its windows of 40 days and the hours and days of a year, filled and copied likewise.
"""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import sqlalchemy as sa
from PIL import Image
from sqlalchemy.engine import Connection

from shm.models import build
from shm.read import write
from shm.simulate import HammerPlan, HangerState, hammer_test
from shm.store import Archive, IdentifiedTest, Lineage, Outcome, Store, Workspace
from shm.store.archive import ArchivedFile
from shm.store.columns import Document
from shm.store.posteriors import key_of
from shm.store.rows import Role
from shm.store.tables import alerts, metadata, recordings, summaries
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
from shm.values.notes import NoteKind
from tests.helpers.diagnoses import a_diagnosis
from tests.helpers.nouns import NOW, a_file, a_response, an_alert
from tests.helpers.streams import TABLES, a_reading, a_window
from tests.helpers.workspaces import START, make_workspace

LINEAGE = Lineage("0" * 64, "1" * 64, "0.1.0")
RECORDED_EVERY = 5
ALERTED = (0.3, 0.5, 0.7, 0.9)
CALLED = 0.95
SAMPLES, ORDERS, RESPONSE_LINES = 1000, 6, 3000
QUANTITIES = ("tension", "transverse_end_stiffness", "longitudinal_end_stiffness")
HOURS_APART = 12
SENSORS = 5
"""Hangers that have a permanent sensor."""
STREAM_DAYS, WINDOW_DAYS = 365, 40
NOTED_EVERY = 25
ENGINEER, PASSWORD = "engineer", "long enough for anybody"
_NOT_COPIED = ("tokens", "journal", "users", "sessions", "changed_settings")
_OF_STREAMS = ("stream_windows", "pooled_readings")
_ALL_OF_STREAMS = ("stream_", "pooled_")


def filled(folder: Path, hangers: int, tests: int) -> Workspace:
    """A workspace of so many hangers with so many tests each, in a SQLite file."""
    settings = {"models": "beam1,beam2", "samples": SAMPLES}
    workspace = make_workspace(folder, hangers=range(1, hangers + 1), settings=settings)
    path = workspace.folder / "bridge.toml"
    sensors = [_sensor(number) for number in range(1, min(SENSORS, hangers) + 1)]
    path.write_text(path.read_text() + "".join(sensors))
    workspace = workspace.reopened()
    first, *others = workspace.bridge.hangers
    with workspace.store() as store:
        _fill(store, workspace.archive, first, tests)
        store.posteriors.save_summaries(first)
        with store.reading() as connection:
            tables = [
                table
                for table in metadata.sorted_tables
                if table.name not in _NOT_COPIED and not table.name.startswith(_ALL_OF_STREAMS)
            ]
            rooms = {table.name: _room(connection, table) for table in tables}
        for place, other in enumerate(others, start=1):
            with store.writing() as connection:
                for table in tables:
                    _copy(connection, table, rooms, place, other)
        _fill_streams(store, len(sensors))
        store.people.add(ENGINEER, Role.ENGINEER, PASSWORD, START)
        for number in range(5):
            text = f"Inspection {number} of the bridge."
            store.notes.add(None, START, NoteKind.INSPECTION, text, ENGINEER, START)
    return workspace


def is_recorded(test: str) -> bool:
    """Whether a test comes from a recording, not from modes that were known."""
    return int(test[-5:]) % RECORDED_EVERY == 0


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
    store.alerts.resolve(raised.id, "engineer", "the pin was greased", raised.raised_at)
    for each in made[::NOTED_EVERY]:
        text, photo = (
            f"Looked at it around {each.name}: nothing loose.",
            _photo() if each is made[0] else b"",
        )
        store.notes.add(hanger.id, each.time, NoteKind.NOTE, text, ENGINEER, each.time, photo)
    diagnosis = replace(a_diagnosis(), tests=(made[-1].name,))
    store.posteriors.save_diagnosis(hanger.id, diagnosis, LINEAGE, made[-1].time)


def _photo() -> bytes:
    """What a camera gives: 12 megapixels."""
    content = BytesIO()
    Image.linear_gradient("L").resize((4000, 3000)).save(content, "JPEG")
    return content.getvalue()


class _Made:
    """One test of a hanger whose tension swings with the year and falls at its end."""

    def __init__(self, hanger: Hanger, number: int, tests: int):
        self.hanger, self.age, self.name = hanger, number / tests, f"test-{number:05}"
        self.rng = np.random.default_rng([1, number])
        self.time: datetime = START + timedelta(hours=HOURS_APART * number)
        self.is_recorded = is_recorded(self.name)
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
        known = {
            "theta_F": (self.share, 0.01),
            "theta_L": (0.98, 0.004),
            **{f"log10_k{end}": (7.2, 0.2) for end in range(1, 5)},
            "sigma": (0.005, 0.001),
        }
        names = (*model.parameter_names, "sigma")
        centre, spread = np.array([known.get(name, (1.0, 0.01)) for name in names]).T
        predicted = tuple(
            PredictedFrequency(
                mode.plane, mode.order, mode.frequency_hz * 1.003, 0.02, mode.frequency_hz
            )
            for mode in self.test.modes
        )
        return Posterior(
            model=model.name,
            hanger=self.hanger.id,
            names=names,
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


def _raw(archive: Archive, hanger: Hanger) -> ArchivedFile:
    """A recording as the logger writes it, which all recorded tests are said to come from."""
    state = HangerState(hanger.nominal_tension_n, 2e7, 2e7, 2e7, 2e7, damping_ratio=0.0015)
    plan = HammerPlan(hits=3, seconds_per_hit=8.0, acceleration_noise_m_s2=0.05)
    made = hammer_test(hanger, state, plan, np.random.default_rng(1), temperature_c=11.5)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "test.csv"
        write(made, path)
        return archive.keep(path)


def _take_in(store: Store, made: _Made, raw: ArchivedFile) -> None:
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


# ---------------------------------------------------------------- permanent sensors


def _sensor(number: int) -> str:
    """The tables of `bridge.toml` of the sensor at a hanger."""
    renamed = TABLES.replace('name = "h3"', f'name = "h{number}"')
    return renamed.replace("hanger = 3", f"hanger = {number}")


def _fill_streams(store: Store, sensors: int) -> None:
    """Fills the first one's up to now, then copies it for the others."""
    ago_h = (datetime.now(UTC) - NOW) // timedelta(hours=1)
    modes = tuple(
        Mode(plane, order, 5.8 * order, 0.002, 0.003)
        for plane in PLANES
        for order in range(1, ORDERS + 1)
    )
    spectrum_db = tuple(range(-100, 0))
    for number in range(WINDOW_DAYS * 144):
        minutes = 60.0 * ago_h - 10.0 * number
        made = replace(a_window(minutes, modes), spectrum_db=spectrum_db)
        store.streams.save_window(replace(made, window=replace(made.window, stream="h1", hanger=1)))
    for period, hours in (("hour", 1), ("six hours", 6), ("day", 24)):
        for number in range(STREAM_DAYS * 24 // hours):
            made_of = a_reading(ago_h - float(hours * number), period)
            store.streams.save_pooled(
                replace(
                    made_of, stream="h1", hanger=1, modes=modes,
                    tension_shift=0.002, tension_shift_sd=0.001,
                    compensated_shift=0.001, compensated_sd=0.001,
                )
            )  # fmt: skip
    for number in range(2, sensors + 1):
        with store.writing() as connection:
            for name in _OF_STREAMS:
                _copy_sensor(connection, metadata.tables[name], number)


def _copy_sensor(connection: Connection, table: sa.Table, number: int) -> None:
    own = {
        "id": "NULL",
        "checksum": "NULL",
        "stream": f"'h{number}'",
        "hanger": f"{number}",
        "document": f"""replace(replace(document, '"stream":"h1"', '"stream":"h{number}"'),
                        '"hanger":1,', '"hanger":{number},')""",
    }
    names = ", ".join(f'"{column.name}"' for column in table.columns)
    chosen = ", ".join(own.get(column.name, f'"{column.name}"') for column in table.columns)
    statement = f"INSERT INTO {table.name} ({names}) SELECT {chosen} FROM {table.name}"
    connection.exec_driver_sql(f"{statement} WHERE hanger = 1")  # nothing in it is a parameter


# ---------------------------------------------------------------- all others


def _copy(
    connection: Connection, table: sa.Table, rooms: dict[str, int], place: int, hanger: Hanger
) -> None:
    """Copies the rows of the first hanger; `rooms` holds the largest number of each table's."""
    names = ", ".join(f'"{column.name}"' for column in table.columns)
    chosen = ", ".join(_copied(column, rooms, place) for column in table.columns)
    statement = f"INSERT INTO {table.name} ({names}) SELECT {chosen} FROM {table.name}"
    statement += f" WHERE {_of_first(table, rooms)}"
    key = key_of(hanger, (place + 1) * rooms["selections"])  # one selection a hanger
    values = {"hanger": hanger.id, "text": f'"hanger": {hanger.id},', "key": key}
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
    if column.name == "checksum":  # of other contents: the commit fills it in anew
        return "NULL"
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
