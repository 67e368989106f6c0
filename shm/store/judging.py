"""What was found of a recording before it counts: kept in one transaction with its tests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.store.blobs import number as number_from
from shm.store.blobs import pack, unpack
from shm.store.database import insert
from shm.store.files import in_force, write_event
from shm.store.hold_rows import HeldTest
from shm.store.outbox import raise_alert
from shm.store.rows import Stage, StoredAlert
from shm.store.stepping import write_step
from shm.store.tables import fingerprints, holds, recordings, tests
from shm.values import Alert, Doubt, Fingerprint


@dataclass(frozen=True, eq=False)
class Judged:
    """What plausibility says of a recording with the sidecar that it was judged with.

    `held` are its tests that are held, `notice` what to tell of that; None where none is.
    `fingerprint` is that of its samples, None where it has none. `out` are the places in the file
    of tests that a person has discarded with this sidecar: they stay so.
    """

    sidecar_as: str | None
    fingerprint: Fingerprint | None = None
    held: tuple[HeldTest, ...] = ()
    notice: Alert | None = None
    hooks: Sequence[str] = ()
    out: tuple[int, ...] = ()


def keep_judgement(
    connection: Connection, recording: Row[Any], judged: Judged, at: datetime
) -> StoredAlert | None:
    """Holds what is in doubt; the notice of that, None where nothing is."""
    if judged.fingerprint is not None:
        _keep_fingerprint(connection, recording.id, judged.fingerprint)
    for position in judged.out:
        _mark(connection, recording.id, position, Stage.REFUSED, at)
    if judged.notice is None:
        return None
    held = _hold_tests(connection, recording.id, judged.held, at)
    document = {
        "message": judged.notice.message,
        "sidecar_as": judged.sidecar_as,
        "tests": [asdict(test) for test in judged.held],
    }
    row = {"recording_id": recording.id, "held_at": at, "document": document}
    hold_id = insert(connection, holds, row)
    reason = reason_of(recording, judged.notice.message, at)
    by_id = recordings.c.id == recording.id
    connection.execute(sa.update(recordings).where(by_id).values(reason=reason))
    write_event(connection, at, "held", recording.id, recording.file_name, reason["message"])
    notice = replace(judged.notice, key=notice_key(judged.notice.hanger, hold_id))
    leading = held[notice.test]
    return raise_alert(connection, leading, None, notice, judged.hooks, at)


def notice_key(hanger: int, hold_id: int) -> str:
    """The key of the notice of a hold: once for each time that a recording is held."""
    return f"hanger-{hanger}:held-{hold_id}"


def fingerprint_from(row: Row[Any]) -> Fingerprint:
    """Marks, noise and places are missing in those of before there were such."""
    return Fingerprint(row.digest, **unpack(row.shapes))


def held_tests_from(document: Mapping[str, Any]) -> tuple[HeldTest, ...]:
    """The tests of a hold back from its document."""
    return tuple(
        HeldTest(
            each["position"],
            each["name"],
            tuple(_doubt_from(doubt) for doubt in each["doubts"]),
            number_from(each["tension_shift"]),
        )
        for each in document["tests"]
    )


def _doubt_from(document: Mapping[str, Any]) -> Doubt:
    return Doubt(**{**document, "instead_of": tuple(document.get("instead_of", ()))})


def _keep_fingerprint(connection: Connection, recording_id: int, found: Fingerprint) -> None:
    former = fingerprints.c.recording_id == recording_id
    connection.execute(sa.delete(fingerprints).where(former))
    arrays = ("shapes", "marks", "noise", "places")
    shapes = pack(**{name: getattr(found, name) for name in arrays})
    row = {"recording_id": recording_id, "digest": found.digest, "shapes": shapes}
    connection.execute(sa.insert(fingerprints).values(row))


def _hold_tests(
    connection: Connection, recording_id: int, held: Sequence[HeldTest], at: datetime
) -> dict[str, int]:
    """Marks the tests that are held; their numbers by the name that they came with."""
    return {
        test.name: _mark(connection, recording_id, test.position, Stage.HELD, at) for test in held
    }


def _mark(
    connection: Connection, recording_id: int, position: int, stage: Stage, at: datetime
) -> int:
    """Brings the test at a place of a file to a stage; its number."""
    own = (tests.c.recording_id == recording_id) & in_force(tests)
    here = own & (tests.c.position == position)
    number: int = connection.scalars(sa.select(tests.c.id).where(here)).one()
    connection.execute(sa.update(tests).where(here).values(stage=stage))
    write_step(connection, recording_id, stage, at, number)
    return number


def reason_of(recording: Row[Any], message: str, at: datetime, remedy: str = "") -> dict[str, Any]:
    """Why a recording is held, or counts no more."""
    return {
        "schema": "shm.reason/1",
        "file": recording.file_name,
        "line": None,
        "channel": None,
        "message": message,
        "remedy": remedy,
        "time": at,
        "sha256": recording.sha256,
    }
