"""Posteriors in numbers: years of tests of a hanger, all hangers at once, without their samples.

A summary is kept beside its posterior. Where there is none yet, as of rows of before there were
any, or where the hanger is described otherwise by now, it is made from the samples anew: what is
answered is the same, only later.
"""

from __future__ import annotations

import hashlib
import json
import logging
import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple
from functools import lru_cache
from statistics import fmean
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.documents import averaged_document, number, value_of
from shm.errors import UsageError
from shm.store.columns import loads
from shm.store.database import Repository
from shm.store.files import is_current
from shm.store.rows import DESCRIBED, BaselineGlance, Numbers, TrendPoint
from shm.store.selects import (
    baselines_now,
    hidden,
    posterior_of_row,
    selection_numbers,
    selection_of,
)
from shm.store.tables import baselines, posterior_tests, posteriors, summaries, tests
from shm.values import NAN, Averaged, BaselineCheck, Hanger, Posterior, Selection, Summary
from shm.values.stated_tension import averaged_now

log = logging.getLogger(__name__)
_AT_ONCE = 50  # technical: posteriors of some 100 kB each
_HANGERS_KNOWN = 4096  # technical: more than any bridge has
_OF_TEST = ("id", "name", "hanger", "time", "taken_at", "temperature_c")
_NAMED = ("stiffness", "parameters")
_NUMBERS_HELD = 1024  # technical: a page shows some hundred
_SUMMARY = summaries.c.key, summaries.c.document.label("summary")


class Trends(Repository):
    """The part of `Posteriors` that answers in numbers."""

    def save_summaries(self, hanger: Hanger, tell: Callable[[float], None] = lambda _: None) -> int:
        """Keeps the summaries of a hanger that are not kept yet; how many there were.

        Some at a time, each time a transaction: it may be killed and begun again.
        """
        with self.reading() as connection:
            key = key_of(hanger, selection_numbers(connection).get(hanger.id))
        missing = self._missing(hanger, key)
        for begin in range(0, len(missing), _AT_ONCE):
            some = missing[begin : begin + _AT_ONCE]
            with self.reading() as connection:
                made = _made(connection, some, {hanger.id: hanger})
            rows = [
                {"posterior_id": id_, "key": key, "document": _document(numbers)}
                for id_, numbers in made.items()
            ]
            with self.writing() as connection:
                former = summaries.c.posterior_id.in_(some)
                connection.execute(sa.delete(summaries).where(former))
                if rows:
                    connection.execute(sa.insert(summaries), rows)
            tell((begin + len(some)) / len(missing))
        return len(missing)

    def _missing(self, hanger: Hanger, key: str) -> list[int]:
        """Return what is shown of a hanger and has no summary under its present description."""
        up_to_date = sa.exists().where(
            summaries.c.posterior_id == posteriors.c.id, summaries.c.key == key
        )
        of_baselines = sa.select(baselines.c.posterior_id).where(
            baselines.c.id.in_(baselines_now(hanger.id))
        )
        looked_at = posteriors.c.id.not_in(hidden) | posteriors.c.id.in_(of_baselines)
        query = sa.select(posteriors.c.id).where(
            posteriors.c.hanger == hanger.id, is_current(posteriors), looked_at, ~up_to_date
        )
        return list(self.scalars(query.order_by(posteriors.c.id)))


def load_points(
    store: Repository, chosen: sa.Select[Any] | Sequence[int], hangers: Iterable[Hanger]
) -> tuple[TrendPoint, ...]:
    """Of tests that are `chosen` by their numbers, by time."""
    newest = (
        sa.select(
            posterior_tests.c.test_id,
            sa.func.max(posterior_tests.c.posterior_id).label("posterior_id"),
        )
        .join(posteriors)
        .where(posterior_tests.c.test_id.in_(chosen), *shown_posteriors())
        .group_by(posterior_tests.c.test_id)
        .subquery()
    )
    of_test = (tests.c[name] for name in _OF_TEST)
    query: sa.Select[Any] = (
        sa.select(*of_test, newest.c.posterior_id, posteriors.c.model, *_SUMMARY)
        .select_from(newest)
        .join(tests, tests.c.id == newest.c.test_id)
        .join(posteriors, posteriors.c.id == newest.c.posterior_id)
        .outerjoin(summaries, summaries.c.posterior_id == posteriors.c.id)
        .order_by(tests.c.time, tests.c.id)
    )
    known = {hanger.id: hanger for hanger in hangers}
    with store.reading() as connection:
        rows = [row for row in connection.execute(query) if row.hanger in known]
        numbers = _numbers(connection, rows, known)
    return tuple(_point(row, numbers[row.posterior_id]) for row in rows)


def baselines_in_numbers(
    connection: Connection, hangers: Iterable[Hanger]
) -> dict[int, BaselineGlance]:
    """The baseline in force of each hanger that has one, by hanger."""
    known = {hanger.id: hanger for hanger in hangers}
    now = baselines_now(next(iter(known)) if len(known) == 1 else None)
    query = (
        sa.select(baselines, posteriors.c.model, posteriors.c.document, *_SUMMARY)
        .join(posteriors, posteriors.c.id == baselines.c.posterior_id)
        .outerjoin(summaries, summaries.c.posterior_id == posteriors.c.id)
        .where(baselines.c.id.in_(now))
        .order_by(baselines.c.hanger)
    )
    rows = [row for row in connection.execute(query) if row.hanger in known]
    numbers = _numbers(connection, rows, known)
    made_of = _made_of(connection, [row.posterior_id for row in rows])
    return {
        row.hanger: _baseline(row, made_of[row.posterior_id], numbers[row.posterior_id])
        for row in rows
    }


def shown_posteriors() -> tuple[sa.ColumnElement[bool], ...]:
    return posteriors.c.id.not_in(hidden), is_current(posteriors)


def _numbers(
    connection: Connection, rows: Sequence[Row[Any]], hangers: Mapping[int, Hanger]
) -> dict[int, Numbers]:
    """Of each row's posterior: as they are kept, or made from its samples."""
    selected = selection_numbers(connection)
    keys = {id_: key_of(hanger, selected.get(id_)) for id_, hanger in hangers.items()}
    kept = {
        row.posterior_id: _from_text(row.summary) for row in rows if row.key == keys[row.hanger]
    }
    missing = [row.posterior_id for row in rows if row.posterior_id not in kept]
    for begin in range(0, len(missing), _AT_ONCE):
        kept |= _made(connection, missing[begin : begin + _AT_ONCE], hangers)
    return kept


def _made(
    connection: Connection, ids: Sequence[int], hangers: Mapping[int, Hanger]
) -> dict[int, Numbers]:
    query = sa.select(posteriors).where(posteriors.c.id.in_(ids))
    compared: dict[int, Selection | None] = {}
    made = {}
    for row in connection.execute(query).all():
        if row.hanger not in compared:
            found = selection_of(connection, row.hanger)
            compared[row.hanger] = None if found is None else found.selection
        posterior = posterior_of_row(row)
        made[row.id] = summarised(posterior, hangers[row.hanger], compared[row.hanger])
    return made


def summarised(posterior: Posterior, hanger: Hanger, selection: Selection | None) -> Numbers:
    """A posterior of `hanger` in numbers, its tension also over the classes of a `selection`."""
    # Imported here because who only asks what is kept needs no model.
    from shm.models import end_stiffness

    try:
        stiffness = end_stiffness(posterior, hanger)
    except UsageError as reason:  # its effect may have left the catalogue, or it is of before
        log.warning("no end stiffness of hanger %d: %s", hanger.id, reason)
        stiffness = {}
    most_probable = posterior.most_probable[posterior.names.index("theta_F")]
    return Numbers(
        tension_n=Summary.of(posterior.tension_n),
        most_probable_tension_n=float(most_probable * posterior.nominal_tension_n),
        stiffness={name: Summary.of(samples) for name, samples in stiffness.items()},
        parameters={name: Summary.of(posterior.parameter(name)) for name in posterior.names},
        averaged=averaged_now(posterior, selection, hanger.limits),
    )


@lru_cache(_HANGERS_KNOWN)
def key_of(hanger: Hanger, selection_id: int | None) -> str:
    """Tells one description of a hanger, and one choice among its classes, from another."""
    return hashlib.sha256(repr((hanger, selection_id)).encode()).hexdigest()


def _document(numbers: Numbers) -> dict[str, Any]:
    """Each summary as a list: there are thousands of them to be read at once."""
    named = {
        part: {name: astuple(each) for name, each in getattr(numbers, part).items()}
        for part in _NAMED
    }
    return {
        "tension_n": astuple(numbers.tension_n),
        "most_probable_tension_n": numbers.most_probable_tension_n,
        "averaged": averaged_document(numbers.averaged),
        **named,
    }


@lru_cache(_NUMBERS_HELD)
def _from_text(text: str) -> Numbers:
    """A summary as it is kept; the latest of all hangers are asked for again and again."""
    document = json.loads(text)
    return Numbers(
        tension_n=_summary(document["tension_n"]),
        most_probable_tension_n=number(document["most_probable_tension_n"]),
        averaged=value_of(Averaged, document["averaged"]),
        **{part: _Summaries(document[part]) for part in _NAMED},
    )


class _Summaries(Mapping[str, Summary]):
    """Each made of its list where it is wanted: of thousands of tests few are asked for all."""

    def __init__(self, lists: Mapping[str, Sequence[float | None]]):
        self._lists = lists

    def __getitem__(self, name: str) -> Summary:
        return _summary(self._lists[name])

    def __iter__(self) -> Iterator[str]:
        return iter(self._lists)

    def __len__(self) -> int:
        return len(self._lists)

    def __repr__(self) -> str:
        return repr(dict(self))


def _summary(values: Sequence[float | None]) -> Summary:
    return Summary(*map(number, values))


def _point(row: Row[Any], numbers: Numbers) -> TrendPoint:
    return TrendPoint(
        test_id=row.id,
        test=row.name,
        hanger=row.hanger,
        time=row.time,
        taken_at=row.taken_at,
        temperature_c=row.temperature_c,
        posterior_id=row.posterior_id,
        model=row.model,
        **vars(numbers),
    )


def _made_of(connection: Connection, ids: Sequence[int]) -> defaultdict[int, list[Row[Any]]]:
    """The names, times and temperatures of the tests of each posterior, by time."""
    of_test = tests.c.name, tests.c.time, tests.c.temperature_c
    columns = (posterior_tests.c.posterior_id, *of_test)
    query: sa.Select[Any] = sa.select(*columns).join(tests)
    query = query.where(posterior_tests.c.posterior_id.in_(ids))
    found = defaultdict[int, list[Row[Any]]](list)
    for row in connection.execute(query.order_by(tests.c.time, tests.c.id)):
        found[row.posterior_id].append(row)
    return found


def _baseline(row: Row[Any], made_of: Sequence[Row[Any]], numbers: Numbers) -> BaselineGlance:
    temperatures_c = [each.temperature_c for each in made_of if math.isfinite(each.temperature_c)]
    plain = {name: getattr(row, name) for name in ("id", "hanger", "set_at", "who", "why", "since")}
    return BaselineGlance(
        **plain,
        model=row.model,
        tests=tuple(each.name for each in made_of),
        temperature_c=fmean(temperatures_c) if temperatures_c else NAN,
        check=_check(row.document),
        begins_at=min((each.time for each in made_of), default=None),
        described=_described(row.document),
        **vars(numbers),
    )


@lru_cache(_NUMBERS_HELD)
def _described(document: str) -> Mapping[str, Any] | None:
    """Return the hanger as it was described then; None of a damaged document."""
    try:
        found: Mapping[str, Any] | None = loads(document).get(DESCRIBED)
    except ValueError:
        return None
    return found


@lru_cache(_NUMBERS_HELD)
def _check(document: str) -> BaselineCheck | None:
    """Return the check of the baseline's tests."""
    found = loads(document).get("baseline_check")
    return None if found is None else value_of(BaselineCheck, found)
