"""What a test's page says of where its results come from, row by row."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from types import SimpleNamespace
from typing import Any

import pytest

from shm.store import FormerTest, Lineage, Step
from shm.store.rows import FormerPosterior
from shm_daemon.web.tests import formers_of, origin, steps, steps_of, superseded

NOON = datetime(2026, 5, 1, 12, tzinfo=UTC)
NOW, BEFORE = Lineage("a" * 64, "b" * 64, "0.2.0"), Lineage("c" * 64, "d" * 64, "0.1.0")


def at(seconds: float) -> datetime:
    return NOON + timedelta(seconds=seconds)


def former(name: str, ended: datetime | None, *posteriors: FormerPosterior) -> FormerTest:
    return FormerTest(1, 7, name, "updated", at(0), ended, BEFORE, posteriors)


STEPS = (
    Step("received", at(0), None),
    Step("read", at(0.04), "0.1.0"),
    Step("identified", at(12.44), "0.2.0", 1, "t1"),
    Step("identified", at(20), "0.2.0", 2, "t2"),
    Step("updated", at(12.44 + 5400), "0.2.0", 1, "t1"),
)
FORMERS = (
    former(
        "t1", at(60), FormerPosterior(1, "beam1", at(1), at(30), NOW),
        FormerPosterior(2, "beam2", at(30), None, NOW),
    ),
    former("t1", None, FormerPosterior(3, "beam1", at(61), at(90), NOW)),
    former("t2", at(60)),
)  # fmt: skip


def view(**changed: Any) -> Any:
    file = SimpleNamespace(
        file_name="t.csv", sha256="e" * 64, size_bytes=99_999, sidecar_as="t.csv.toml"
    )
    recording = SimpleNamespace(file=file, id=7, received_at=NOON)
    store = SimpleNamespace(
        journal=SimpleNamespace(list_steps=lambda id_: STEPS if id_ == 7 else ()),
        tests=SimpleNamespace(list_former=lambda id_: FORMERS if id_ == 7 else ()),
    )
    stored = SimpleNamespace(test=SimpleNamespace(id="t1"), lineage=NOW)
    made = {
        "recording": recording, "store": store, "stored": stored, "is_archived": True,
        "order": SimpleNamespace(terms=NOW),
    }  # fmt: skip
    return SimpleNamespace(**(made | changed))


def test_each_step_of_the_file_and_of_this_test_says_how_long_after_the_one_before() -> None:
    assert [each.test for each in steps_of(view())] == [None, None, "t1", "t1"]
    assert steps(view()).headings == ("stage", "of", "reached", "after", "with")
    assert steps(view()).rows == (
        ("received", "file", "2026-05-01 12:00:00 UTC", "at once", "not noted"),
        ("read", "file", "2026-05-01 12:00:00 UTC", "at once", "shm 0.1.0"),
        ("identified", "test", "2026-05-01 12:00:12 UTC", "12.4 s", "shm 0.2.0"),
        ("updated", "test", "2026-05-01 13:30:12 UTC", "1.5 h", "shm 0.2.0"),
    )


def test_what_was_superseded_is_told_and_what_is_in_force_is_not() -> None:
    assert [each.name for each in formers_of(view())] == ["t1", "t1"]
    assert superseded(view()).headings == ("what", "made", "superseded", "with", "settings")
    assert [(row[0], *row[3:]) for row in superseded(view()).rows] == [
        ("identification", "shm 0.1.0", "d" * 12),
        ("posterior, beam1", "shm 0.2.0", "b" * 12),
        ("posterior, beam1", "shm 0.2.0", "b" * 12),
    ]
    assert [row[1:3] for row in superseded(view()).rows] == [
        ("2026-05-01 12:00 UTC", "2026-05-01 12:01 UTC"),
        ("2026-05-01 12:00 UTC", "2026-05-01 12:00 UTC"),
        ("2026-05-01 12:01 UTC", "2026-05-01 12:01 UTC"),
    ]


def test_the_file_stands_there_with_its_checksums_and_with_what_made_the_results() -> None:
    assert dict(origin(view()).rows) == {
        "raw file": "t.csv",
        "its SHA-256": "e" * 64,
        "its size": "99999 bytes",
        "received": "2026-05-01 12:00 UTC",
        "in the archive": "yes",
        "sidecar": "came with it",
        "checksum of the input": "a" * 64,
        "checksum of the settings": "b" * 64,
        "identified with": "shm 0.2.0",
        "settings, description and version": "as they are now",
    }


@pytest.mark.parametrize(
    ("what", "changed", "told"),
    [
        ("in the archive", {"is_archived": False}, "no: taken out"),
        (
            "settings, description and version", {"order": SimpleNamespace(terms=BEFORE)},
            "have changed since: `shm ingest --again 7` identifies it anew",
        ),
    ],
)  # fmt: skip
def test_what_is_otherwise_is_said(what: str, changed: dict[str, Any], told: str) -> None:
    assert dict(origin(view(**changed)).rows)[what] == told


def test_a_large_file_without_a_sidecar_says_so() -> None:
    made = view()
    made.recording.file.size_bytes, made.recording.file.sidecar_as = 123_456_789, None
    rows = dict(origin(made).rows)
    assert (rows["its size"], rows["sidecar"]) == ("123.46 MB", "none")
