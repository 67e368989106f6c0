"""Verbs on tests and posteriors: each result and its "done" are one transaction."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.documents import posterior_document
from shm.modes_document import test_document
from shm.store.blobs import pack_response, pack_samples
from shm.store.database import Database, insert
from shm.store.files import in_force
from shm.store.judging import Judged, keep_judgement
from shm.store.rows import (
    DESCRIBED,
    IdentifiedTest,
    Lineage,
    Stage,
    StoredAlert,
    StoredTest,
)
from shm.store.stepping import write_step
from shm.store.tables import (
    baselines,
    posterior_tests,
    posteriors,
    recordings,
    selection_entries,
    selections,
    tests,
)
from shm.values import Posterior, Selection

_PROGRESS = (Stage.IDENTIFIED, Stage.UPDATED, Stage.WATCHED)


class Results(Database):
    """The part of the store that keeps what was computed."""

    def identified(
        self,
        recording_id: int,
        found: Sequence[IdentifiedTest],
        lineage: Lineage,
        at: datetime,
        judged: Judged | None = None,
    ) -> StoredAlert | None:
        """Keeps the tests of a recording; does nothing where another process was first.

        Nor where it has another sidecar by now than it was `judged` with: it waits to be done with
        that. The notice where tests of it are held.
        """
        with self.writing() as connection:
            query = sa.select(recordings).where(recordings.c.id == recording_id)
            recording = connection.execute(query).one()
            if recording.stage != Stage.RECEIVED:
                return None
            if judged is not None and judged.sidecar_as != recording.sidecar_as:
                return None
            kept = _positions(connection, recording_id)
            for item in (item for item in found if item.position not in kept):
                values = {**_test_values(connection, item, recording), **lineage.columns}
                test_id = insert(connection, tests, {**values, "identified_at": at})
                write_step(connection, recording_id, Stage.IDENTIFIED, at, test_id)
            hanger = found[0].test.hanger
            by_id = recordings.c.id == recording_id
            connection.execute(sa.update(recordings).where(by_id).values(hanger=hanger))
            notice = keep_judgement(connection, recording, judged, at) if judged else None
            advance_recordings(connection, [recording_id], at)
            return notice

    def selected(
        self,
        hanger: int,
        chosen: Sequence[StoredTest],
        selection: Selection,
        lineage: Lineage,
        at: datetime,
    ) -> None:
        """Keeps the competing posteriors; the most probable is the hanger's baseline."""
        with self.writing() as connection:
            if not all_at(connection, chosen, Stage.IDENTIFIED) or _has(connection, hanger):
                return
            ids = [
                insert_posterior(connection, hanger, posterior, chosen, lineage, at)
                for posterior in selection.posteriors
            ]
            probable = list(zip(ids, selection.probabilities, strict=True))
            insert_selection(connection, hanger, selection.selected.model, probable, at)
            why = "the first test" if len(chosen) == 1 else f"the first {len(chosen)} tests"
            insert_baseline(connection, hanger, ids[0], "shm", why, at)
            move(connection, chosen, Stage.WATCHED, at)

    def updated(
        self,
        test: StoredTest,
        posterior: Posterior,
        lineage: Lineage,
        at: datetime,
        *,
        to_watch: bool = True,
    ) -> None:
        """Keeps the posterior of one test; does nothing where another process was first.

        `to_watch` is false of a test from which the baseline itself was made.
        """
        with self.writing() as connection:
            if all_at(connection, [test], Stage.IDENTIFIED):
                insert_posterior(connection, test.hanger, posterior, [test], lineage, at)
                move(connection, [test], Stage.UPDATED if to_watch else Stage.WATCHED, at)


def move(connection: Connection, chosen: Iterable[StoredTest], stage: Stage, at: datetime) -> None:
    """Brings tests to a stage, and their recordings along."""
    chosen = list(chosen)
    ids = [test.id for test in chosen]
    connection.execute(sa.update(tests).where(tests.c.id.in_(ids)).values(stage=stage))
    for test in chosen:
        write_step(connection, test.recording_id, stage, at, test.id)
    advance_recordings(connection, {test.recording_id for test in chosen}, at)


def advance_recordings(connection: Connection, ids: Collection[int], at: datetime) -> None:
    """A recording stands where the least advanced of its tests stands, and is held with one."""
    for recording_id in ids:
        query = sa.select(tests.c.stage).where(
            tests.c.recording_id == recording_id, in_force(tests), tests.c.stage != Stage.REFUSED
        )
        stages = [Stage(stage) for stage in connection.scalars(query)]
        stage = Stage.HELD if Stage.HELD in stages else min(stages, key=_PROGRESS.index)
        stage = Stage.DONE if stage is Stage.WATCHED else stage
        moved = connection.execute(
            sa.update(recordings)
            .where(recordings.c.id == recording_id)
            .where(recordings.c.stage.not_in([Stage.REFUSED, stage]))
            .values(stage=stage)
        )
        if moved.rowcount:
            write_step(connection, recording_id, stage, at)


def _positions(connection: Connection, recording_id: int) -> set[int]:
    query = sa.select(tests.c.position).where(tests.c.recording_id == recording_id, in_force(tests))
    return set(connection.scalars(query))


def _test_values(
    connection: Connection, item: IdentifiedTest, recording: Row[Any]
) -> dict[str, Any]:
    name = _free_name(connection, item, recording)
    return {
        "recording_id": recording.id,
        "position": item.position,
        "name": name,
        "time": item.test.time or recording.received_at,
        "stage": Stage.IDENTIFIED,
        **test_contents(item, name),
    }


def test_contents(item: IdentifiedTest, name: str) -> dict[str, Any]:
    """What an identification gave, by column."""
    response = item.frequency_response
    return {
        "hanger": item.test.hanger,
        "document": test_document(replace(item.test, id=name)),
        "frequency_response": None if response is None else pack_response(response),
        "notes": list(item.notes),
        "quality": [asdict(check) for check in item.quality],
        "set_aside": [asdict(mode) for mode in item.set_aside],
        "taken_at": item.test.time,
        "temperature_c": item.test.temperature_c,
    }


def _free_name(connection: Connection, item: IdentifiedTest, recording: Row[Any]) -> str:
    """The test's own name or, where its hanger has one such, that name and its file's checksum.

    A test identified again keeps the one of these that it had.
    """
    own, plain = f"{item.test.id}-{recording.sha256[:8]}-{item.position}", item.test.id
    query = sa.select(tests.c.name).where(tests.c.hanger == item.test.hanger)
    here = (tests.c.recording_id == recording.id) & (tests.c.position == item.position)
    former = connection.scalar(query.where(here).order_by(tests.c.id.desc()).limit(1))
    taken = query.where(tests.c.name == plain, in_force(tests))
    free = former != own and connection.execute(taken).first() is None
    return plain if free else own


def all_at(connection: Connection, chosen: Iterable[StoredTest], stage: Stage) -> bool:
    """Whether tests are in force and still at a stage: another process may have been first."""
    query = sa.select(tests.c.stage, tests.c.superseded_at).where(
        tests.c.id.in_([test.id for test in chosen])
    )
    rows = connection.execute(query).all()
    return all(row.stage == stage and row.superseded_at is None for row in rows)


def _has(connection: Connection, hanger: int) -> bool:
    query = sa.select(selections.c.id).where(selections.c.hanger == hanger)
    return connection.execute(query).first() is not None


def insert_posterior(
    connection: Connection,
    hanger: int,
    posterior: Posterior,
    chosen: Sequence[StoredTest],
    lineage: Lineage,
    at: datetime,
) -> int:
    """Keeps a posterior of tests; its number."""
    values = posterior_values(hanger, posterior, chosen, lineage, at)
    posterior_id = insert(connection, posteriors, values)
    pairs = [{"posterior_id": posterior_id, "test_id": test.id} for test in chosen]
    connection.execute(sa.insert(posterior_tests), pairs)
    return posterior_id


def posterior_values(
    hanger: int,
    posterior: Posterior,
    chosen: Sequence[StoredTest],
    lineage: Lineage,
    at: datetime,
) -> Mapping[str, Any]:
    """A posterior of tests, by column."""
    document = posterior_document(posterior)
    if lineage.described is not None:
        document[DESCRIBED] = dict(lineage.described)
    return {
        **lineage.columns,
        "hanger": hanger,
        "model": posterior.model,
        "time": max(test.time for test in chosen),
        "document": document,
        "samples": pack_samples(posterior),
        "log_evidence": posterior.log_evidence,
        "log_evidence_sd": posterior.log_evidence_sd,
        "seed": posterior.seed,
        "updated_at": at,
    }


def insert_selection(
    connection: Connection,
    hanger: int,
    model: str,
    probable: Sequence[tuple[int, float]],
    at: datetime,
) -> int:
    """Keeps which class is in force and, that one first, what competed; its number.

    `probable` holds the numbers of the posteriors with their probabilities.
    """
    row = {"hanger": hanger, "model": model, "selected_at": at}
    selection_id = insert(connection, selections, row)
    entries = [
        {"selection_id": selection_id, "posterior_id": id_, "rank": rank, "probability": p}
        for rank, (id_, p) in enumerate(probable)
    ]
    connection.execute(sa.insert(selection_entries), entries)
    return selection_id


def insert_baseline(
    connection: Connection,
    hanger: int,
    posterior_id: int,
    who: str,
    why: str,
    at: datetime,
    since: datetime | None = None,
) -> int:
    """Keeps what later tests are compared with; its number."""
    row = {"hanger": hanger, "posterior_id": posterior_id, "who": who, "why": why}
    return insert(connection, baselines, {**row, "set_at": at, "since": since})
