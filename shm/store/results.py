"""Rows of results, and how far their tests have come, within the caller's transaction."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection

from shm.documents import posterior_document
from shm.modes_document import test_document
from shm.store.blobs import pack_response, pack_samples
from shm.store.database import insert
from shm.store.files import in_force, write_step
from shm.store.rows import DESCRIBED, IdentifiedTest, Lineage, Stage, StoredTest
from shm.store.tables import (
    baselines,
    posterior_tests,
    posteriors,
    recordings,
    selection_entries,
    selections,
    tests,
)
from shm.values import Posterior

_PROGRESS = (Stage.IDENTIFIED, Stage.UPDATED, Stage.WATCHED)


def all_at(connection: Connection, chosen: Iterable[StoredTest], stage: Stage) -> bool:
    """Whether tests are in force and still at a stage: another process may have been first."""
    query = sa.select(tests.c.stage, tests.c.superseded_at).where(
        tests.c.id.in_([test.id for test in chosen])
    )
    rows = connection.execute(query).all()
    return all(row.stage == stage and row.superseded_at is None for row in rows)


def move(connection: Connection, chosen: Iterable[StoredTest], stage: Stage, at: datetime) -> None:
    """Brings tests to a stage, and their recordings along."""
    move_numbers(connection, {test.id: test.recording_id for test in chosen}, stage, at)


def move_numbers(
    connection: Connection, chosen: Mapping[int, int], stage: Stage, at: datetime
) -> None:
    """The same of tests by their numbers, each with that of its recording."""
    connection.execute(sa.update(tests).where(tests.c.id.in_(list(chosen))).values(stage=stage))
    for test_id, recording_id in chosen.items():
        write_step(connection, recording_id, stage, at, test_id)
    advance_recordings(connection, sorted(set(chosen.values())), at)


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
