"""Rows that somebody took out, found by what other rows say of them.

A row leaves traces: others refer to it, a number is skipped, a stage was reached or an event is
told of it, a document names it. What leaves none (see `docs/operation.md`) is not missed.
"""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row, RowMapping

from shm.store.copying import skipped
from shm.store.missing_rules import HISTORY, RESTORE, RULES, WATCH_AGAIN, WATCH_MISSING, Rule
from shm.store.tables import events, metadata

ALERT_RULES = (
    Rule(
        "acknowledgements",
        "the acknowledgement of alert {alert} is missing: its hold was {decision}.",
        "Acknowledge it anew: `shm alerts ack {alert} --why WHY`.",
        """
        SELECT a.id AS alert, h.decision FROM holds h JOIN recordings r ON r.id = h.recording_id
        JOIN alerts a ON a.key = 'hanger-' || CAST(r.hanger AS TEXT) || ':held-'
            || CAST(h.id AS TEXT)
        WHERE h.decision IS NOT NULL
            AND NOT EXISTS (SELECT 1 FROM acknowledgements k WHERE k.alert_id = a.id)
        """,
    ),
    Rule(
        "deliveries",
        "a delivery is missing: test {test} has a step notified, and no alert of it was told.",
        HISTORY,
        """
        SELECT s.test_id AS test, count(*) AS steps,
            (SELECT count(*) FROM alerts x WHERE x.test_id = s.test_id
                AND EXISTS (SELECT 1 FROM deliveries d WHERE d.alert_id = x.id)) AS told
        FROM steps s WHERE s.stage = 'notified' GROUP BY s.test_id
        """,
        ("steps", "told"),
    ),
    Rule(
        "deliveries",
        "a delivery is missing: {hook} may not be told that alert {alert} is resolved.",
        HISTORY,
        """
        SELECT d.alert_id AS alert, d.hook FROM deliveries d
        JOIN resolutions e ON e.alert_id = d.alert_id
        WHERE d.news = 'raised' AND d.state = 'delivered' AND NOT EXISTS (
            SELECT 1 FROM deliveries o WHERE o.alert_id = d.alert_id AND o.hook = d.hook
                AND o.news = 'resolved')
        """,
    ),
    Rule(
        "resolutions",
        "the resolution of alert {alert} is missing: {hook} is owed the news of it.",
        RESTORE,
        """
        SELECT d.alert_id AS alert, d.hook FROM deliveries d
        WHERE d.news = 'resolved' AND NOT EXISTS (
            SELECT 1 FROM resolutions e WHERE e.alert_id = d.alert_id)
        """,
    ),
)


ACCEPTED = "accepted"
"""The kind of event by which a person accepts that a row is gone."""

UNHELD = ("withdrawn", "reinstated")
"""Decisions on what was not held: no step, no event and no alert tells of a hold."""

_ROWS_AT_ONCE = 500  # technical: documents of some kB each


@dataclass(frozen=True)
class MissingRow:
    """A row that must be there: of which table, its number where that is known, and what tells.

    `referred`: others refer to it, so that a store with foreign keys does not take their rows.
    Where its number is not known it stands for `count` rows, and `about` says of what, in words
    that stay the same while more is done and counted.
    """

    table: str
    id: int | None
    message: str
    remedy: str
    referred: bool = False
    count: int = 1
    about: str = ""

    def __str__(self) -> str:
        return f"{self.message} {self.remedy}"

    @property
    def only_in_backup(self) -> bool:
        """Nothing here makes it again, and nothing stands on it."""
        return self.remedy in (RESTORE, HISTORY) and not self.referred

    @property
    def key(self) -> str:
        """What it is called by where a person has accepted that it is gone."""
        return (self.about or self.message) if self.id is None else f"{self.table}/{self.id}"

    def beyond(self, accepted: Mapping[str, int]) -> int:
        """How many rows are missing beyond those that were accepted.

        An older version called them by the message, whatever was counted in it.
        """
        return (
            self.count
            - accepted.get(self.key, 0)
            - (self.key != self.message) * (accepted.get(self.message, 0))
        )


def missing_rows(connection: Connection) -> tuple[MissingRow, ...]:
    """Every row that is missed and not accepted as gone; of a number that is known, named once."""
    accepted = _accepted(connection)
    found: dict[str, MissingRow] = {}
    for row in (*_referred(connection), *_by_documents(connection), *_by_rules(connection)):
        found.setdefault(row.key, row)
    for row in _gaps(connection, accepted):
        found.setdefault(row.key, row)
    left = ((row, row.beyond(accepted)) for row in found.values())
    return tuple(replace(row, count=count) for row, count in left if count > 0)


def _accepted(connection: Connection) -> Mapping[str, int]:
    """How many rows were accepted as gone, by what they were called: an event a row."""
    query = sa.select(events.c.file_name).where(events.c.kind == ACCEPTED)
    return Counter(connection.scalars(query))


def _by_rules(connection: Connection) -> Iterator[MissingRow]:
    for rule, query in _queries():
        for row in connection.execute(query).mappings():
            yield _missed(rule, row)


@cache
def _queries() -> tuple[tuple[Rule, sa.TextClause], ...]:
    return tuple(
        (rule, sa.text(_lacking(rule).replace(":", "\\:"))) for rule in (*RULES, *ALERT_RULES)
    )


def _lacking(rule: Rule) -> str:
    if not rule.counts:
        return rule.query
    more, fewer = rule.counts[:2]
    return f"SELECT * FROM ({rule.query}) found WHERE {more} > {fewer}"  # noqa: S608 - no input


def _missed(rule: Rule, row: RowMapping) -> MissingRow:
    told = {str(name): value for name, value in row.items()}
    said, remedy = rule.said.format(**told), rule.remedy.format(**told)
    if not rule.counts:
        return MissingRow(rule.table, None, said, remedy)
    more, fewer = rule.counts[:2]
    about = rule.said.format(**{**told, **dict.fromkeys(rule.counts, "so many")})
    return MissingRow(rule.table, None, said, remedy, False, told[more] - told[fewer], about)


def _referred(connection: Connection) -> Iterator[MissingRow]:
    """Rows that others refer to."""
    referring: defaultdict[tuple[str, int], Counter[str]] = defaultdict(Counter)
    for name, table, query in _references():
        for id_, count in connection.execute(query):
            referring[name, id_][table] += count
    for (name, id_), counts in referring.items():
        told = " and ".join(f"{count} of {by}" for by, count in counts.items())
        yield MissingRow(
            name, id_, f"row {id_} of {name} is missing: rows refer to it, {told}.", RESTORE, True
        )


@cache
def _references() -> tuple[tuple[str, str, sa.Select[Any]], ...]:
    """Each table that is referred to, by which, and how often to rows of it that are not there."""
    found = []
    for table in metadata.sorted_tables:
        for column in table.columns:
            for key in column.foreign_keys:
                there = key.column.table.alias()
                gone = ~sa.exists().where(there.c[key.column.name] == column)
                query: sa.Select[Any] = sa.select(column, sa.func.count())
                query = query.where(column.is_not(None), gone).group_by(column)
                found.append((key.column.table.name, table.name, query))
    return tuple(found)


def _gaps(connection: Connection, accepted: Collection[str]) -> Iterator[MissingRow]:
    for table, ids in skipped(connection, accepted).items():
        remedy = HISTORY if table in ("steps", "events") else RESTORE
        for id_ in ids:
            yield MissingRow(
                table, id_, f"row {id_} of {table} is missing: its number is skipped.", remedy
            )


def _by_documents(connection: Connection) -> Iterator[MissingRow]:
    """Rows that are named by the documents of others."""
    for name, columns, told in (
        ("holds", ("recording_id", "decision"), _held_steps),
        ("posteriors", (), _made_of),
        ("watches", ("test_id", "baseline_id", "superseded_at"), _said_of),
        ("alerts", ("key",), _told_to),
    ):
        try:
            yield from told(connection, _documents(connection, name, columns))
        except (TypeError, ValueError):
            said = f"what rows of {name} say of others cannot be told: one of them is damaged."
            yield MissingRow(name, None, said, "Mend that one, then check again.")


_Documents = Iterable[tuple[Row[Any], dict[str, Any]]]


def _documents(connection: Connection, name: str, columns: Iterable[str]) -> _Documents:
    """Rows with their documents; one that cannot be read is damaged, which is told elsewhere."""
    named: list[sa.ColumnClause[Any]] = [sa.column(c) for c in ("id", "document", *columns)]
    query = sa.select(*named).select_from(sa.table(name))
    for row in connection.execute(query.execution_options(yield_per=_ROWS_AT_ONCE)):
        try:
            document = json.loads(row.document)
        except (TypeError, ValueError):
            continue
        if isinstance(document, dict):
            yield row, document


def _counts(connection: Connection, query: str) -> Mapping[Any, int]:
    """How many rows there are, by what the query has before that."""
    return {tuple(row)[:-1]: row[-1] for row in connection.execute(sa.text(query))}


def _held_steps(connection: Connection, held: _Documents) -> Iterator[MissingRow]:
    steps = _counts(
        connection,
        "SELECT recording_id, count(*) FROM steps "
        "WHERE stage = 'held' AND test_id IS NOT NULL GROUP BY recording_id",
    )
    named: Counter[int] = Counter()
    for row, document in held:
        if row.decision not in UNHELD:
            named[row.recording_id] += len(document.get("tests", ()))
    for recording, count in named.items():
        lost = count - steps.get((recording,), 0)
        if lost > 0:
            about = f"a step of recording {recording} is missing: {{}} times a test was held."
            said, about = about.format(count), about.format("so many")
            yield MissingRow("steps", None, said, HISTORY, False, lost, about)


def _made_of(connection: Connection, made: _Documents) -> Iterator[MissingRow]:
    pairs = _counts(
        connection, "SELECT posterior_id, count(*) FROM posterior_tests GROUP BY posterior_id"
    )
    for row, document in made:
        named, there = len(document.get("tests", ())), pairs.get((row.id,), 0)
        if named > there:
            said = f"posterior {row.id} was made of {named} tests, {there} are noted."
            yield MissingRow("posterior_tests", None, f"a row is missing: {said}", RESTORE)


def _said_of(connection: Connection, watched: _Documents) -> Iterator[MissingRow]:
    """Shifts and alerts of what the watch said; watches of the shifts."""
    shifts = _counts(
        connection,
        "SELECT test_id, baseline_id, count(*) FROM drifts "
        "WHERE superseded_at IS NULL GROUP BY test_id, baseline_id",
    )
    raised = set(_counts(connection, "SELECT id, test_id, 1 FROM alerts"))
    seen = set()
    for row, document in watched:
        test = row.test_id
        if row.superseded_at is None:
            seen.add((test, row.baseline_id))
            named, there = len(document.get("shifts", ())), shifts.get((test, row.baseline_id), 0)
            if named > there:
                recording = _recording_of(connection, test)
                said = f"a shift of test {test} is missing: {named} were told, {there} are there."
                yield MissingRow("drifts", None, said, WATCH_AGAIN.format(recording=recording))
        alert = document.get("alert")
        if alert is not None and (alert, test) not in raised:
            said = f"row {alert} of alerts is missing: the watch raised it after test {test}."
            yield MissingRow("alerts", alert, said, RESTORE)
    # Schemas before 0004 had shifts without a watch.
    first = connection.scalar(sa.text("SELECT min(test_id) FROM watches"))
    for test, baseline in shifts:
        if (test, baseline) not in seen and first is not None and test >= first:
            told = {"test": test, "recording": _recording_of(connection, test)}
            said, remedy = WATCH_MISSING.format(**told), WATCH_AGAIN.format(**told)
            yield MissingRow("watches", None, said, remedy)


def _recording_of(connection: Connection, test: int) -> object:
    of_test: sa.Select[Any] = sa.select(sa.column("recording_id")).select_from(sa.table("tests"))
    return connection.scalar(of_test.where(sa.column("id") == test))


def _told_to(connection: Connection, alerts: _Documents) -> Iterator[MissingRow]:
    """What is owed of alerts, holds that were told of, and notices of holds."""
    owed = set(
        _counts(connection, "SELECT alert_id, hook, 1 FROM deliveries WHERE news = 'raised'")
    )
    rows = connection.execute(sa.text("SELECT id, decision FROM holds"))
    decisions: dict[int, str | None] = {row.id: row.decision for row in rows}
    holds = set(decisions)
    told = set()
    for row, document in alerts:
        for hook in document.get("hooks", ()):
            if (row.id, hook) not in owed:
                said = f"the delivery of alert {row.id} to {hook} is missing: it may not be told."
                yield MissingRow("deliveries", None, said, f"See `shm alerts`. {RESTORE}")
        _, is_notice, number = str(row.key).partition(":held-")
        if is_notice and number.isdecimal():
            told.add(int(number))
            if int(number) not in holds:
                said = f"row {number} of holds is missing: alert {row.id} tells of it."
                yield MissingRow("holds", int(number), said, RESTORE)
    unheld = {id_ for id_, decision in decisions.items() if decision in UNHELD}
    for hold in sorted(holds - told - unheld):
        yield MissingRow("alerts", None, f"the alert that told of hold {hold} is missing.", RESTORE)
