"""Where a test's results come from: its file, checksums, steps with times, what was superseded."""

from __future__ import annotations

from datetime import datetime

from shm.report import formatting
from shm.report.paper import Table
from shm.store import FormerTest, Lineage, Step
from shm_daemon.web.modal_test_view import TestView

_AT_ONCE_S = 0.05  # what would be rounded to 0.0 s


def origin(view: TestView) -> Table:
    """File, checksums and version; a checksum is written out, for it is there to be compared."""
    file, lineage = view.recording.file, view.stored.lineage
    facts = {
        "raw file": file.file_name,
        "its SHA-256": file.sha256,
        "its size": _size(file.size_bytes),
        "received": formatting.moment(view.recording.received_at),
        "in the archive": "yes" if view.is_archived else "no: taken out",
        "sidecar": "came with it" if file.sidecar_as else "none",
        "checksum of the input": lineage.input_sha256,
        "checksum of the settings": lineage.settings_sha256,
        "identified with": f"shm {lineage.version}",
        "settings, description and version": _now(view),
    }
    return Table("Raw file and lineage", ("what", "value"), tuple(facts.items()))


def _now(view: TestView) -> str:
    if view.order.terms == view.stored.lineage:
        return "as they are now"
    return f"have changed since: `shm ingest --again {view.recording.id}` identifies it anew"


def steps_of(view: TestView) -> tuple[Step, ...]:
    """The steps of the file, and those of this test of it."""
    found = view.store.recordings.list_steps(view.recording.id)
    return tuple(step for step in found if step.test in (None, view.stored.test.id))


def steps(view: TestView) -> Table:
    """Each stage that was reached and when, with the time since the one before."""
    found = steps_of(view)
    before: list[datetime | None] = [None, *(step.at for step in found)]
    rows = tuple(
        (
            step.stage,
            "test" if step.test else "file",
            _second(step.at),
            _after(step.at, then),
            f"shm {step.version}" if step.version else "not noted",
        )
        for step, then in zip(found, before, strict=False)
    )
    return Table("Steps", ("stage", "of", "reached", "after", "with"), rows)


def formers_of(view: TestView) -> tuple[FormerTest, ...]:
    """Every identification of this test, in force or superseded, oldest first."""
    found = view.store.tests.list_former(view.recording.id)
    return tuple(each for each in found if each.name == view.stored.test.id)


def superseded(view: TestView) -> Table:
    """Identifications and posteriors that later runs have replaced."""
    rows: list[tuple[str, ...]] = []
    for test in formers_of(view):
        if test.superseded_at:
            rows.append(
                _former("identification", test.identified_at, test.superseded_at, test.lineage)
            )
        for each in test.posteriors:
            if each.superseded_at:
                what = f"posterior, {formatting.model_class(each.model)}"
                rows.append(_former(what, each.updated_at, each.superseded_at, each.lineage))
    return Table(
        "Superseded results", ("what", "made", "superseded", "with", "settings"), tuple(rows)
    )


def _former(what: str, made: datetime, ended: datetime, lineage: Lineage) -> tuple[str, ...]:
    return (
        what,
        formatting.moment(made),
        formatting.moment(ended),
        f"shm {lineage.version}",
        lineage.settings_sha256[:12],
    )


def _second(at: datetime) -> str:
    return f"{at:%Y-%m-%d %H:%M:%S} UTC"


def _after(at: datetime, then: datetime | None) -> str:
    seconds = (at - then).total_seconds() if then else 0.0
    if seconds < _AT_ONCE_S:
        return "at once"
    return (
        f"{formatting.plain(seconds)} s"
        if seconds < 3600
        else f"{formatting.plain(seconds / 3600)} h"
    )


def _size(size_bytes: int) -> str:
    return f"{size_bytes / 1e6:.2f} MB" if size_bytes >= 1e5 else f"{size_bytes} bytes"
