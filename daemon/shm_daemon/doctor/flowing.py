"""Whether the work flows: daemon, spool, what is under way, quarantine, raw files."""

from __future__ import annotations

import json
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

from shm.report.words import counted
from shm.store import Stage
from shm_daemon.doctor.contract import Examined, Finding, fault, ok, some, warning
from shm_daemon.heartbeat import patience_s, seconds_since_beat, told
from shm_daemon.spool import left_alone, scan

_WAITS_LONG = timedelta(minutes=10)
_STUCK = timedelta(hours=1)
_STUCK_BEHIND_OTHERS = timedelta(days=1)
_NOTHING_MOVES = timedelta(minutes=15)
_FORGOTTEN = timedelta(days=1)
_LOOKED_AT = 100
_BEGIN = "Begin it: `shm daemon`, or the service (docs/operation.md)."


def check_daemon(examined: Examined) -> Iterator[Finding]:
    """Whether a daemon is active, and its loop goes round."""
    workspace = examined.workspace
    holder, ago_s = workspace.holder(), seconds_since_beat(workspace)
    seen = "never seen here" if ago_s is None else f"last seen {told(timedelta(seconds=ago_s))} ago"
    if holder is None:
        yield warning("daemon", f"none is active, {seen}", _BEGIN)
    elif ago_s is None or ago_s > patience_s(workspace):
        yield warning(
            "daemon",
            f"{holder} holds the store, but a daemon's loop was {seen}",
            "If that is no `shm ingest` or `shm db` at work, the daemon hangs: begin it again.",
        )
    else:
        yield ok("daemon", f"{holder} is active, {seen}")


def check_spool(examined: Examined) -> Iterator[Finding]:
    """Whether files wait in the spool, or lie there for ever."""
    spool = examined.workspace.spool
    ages = [_age(path, examined.now) for path in scan(spool)]
    if not ages:
        yield ok("spool", "empty")
    else:
        found = f"{counted(len(ages), 'file')} in the queue, the oldest for {told(max(ages))}"
        late = max(ages) > _WAITS_LONG
        remedy = "Is a daemon active, and what does its log say of these files?"
        yield warning("spool", found, remedy) if late else ok("spool", found)
    forgotten = [path for path in left_alone(spool) if _age(path, examined.now) > _FORGOTTEN]
    if forgotten:
        yield warning(
            "spool",
            f"left alone there for more than a day: {some([path.name for path in forgotten])}",
            "Uploads that broke off, or sidecars without their file: send again, or delete them.",
        )


def check_under_way(examined: Examined) -> Iterator[Finding]:
    """Whether a recording has been standing still."""
    store, now = examined.store, examined.now
    unready = _without_baseline(examined)
    standing = [
        each
        for each in store.standing()
        if each.stage is Stage.RECEIVED or each.hanger not in unready
    ]
    if not standing:
        yield ok("recordings", "none is on its way")
        return
    oldest = min(standing, key=lambda each: each.since)
    newest_at = store.newest_row_at() or now
    waits, idle = now - oldest.since, now - newest_at
    found = (
        f"{len(standing)} on their way; {oldest.file_name} (recording {oldest.id}) has been "
        f"{oldest.stage} for {told(waits)}"
    )
    if waits > _STUCK_BEHIND_OTHERS or (waits > _STUCK and idle > _NOTHING_MOVES):
        remedy = f"See the daemon's log, then `shm ingest --again {oldest.id}`."
        yield warning("recordings", found, remedy)
    else:
        yield ok("recordings", found)


def check_quarantine(examined: Examined) -> Iterator[Finding]:
    """Which files were refused, and since when."""
    folder = examined.workspace.quarantine.folder
    reasons = sorted(folder.glob("*.reason.json"), key=lambda path: path.stat().st_mtime)
    if not reasons:
        yield ok("quarantine", "empty")
        return
    first, last = (_age(path, examined.now) for path in (reasons[0], reasons[-1]))
    yield warning(
        "quarantine",
        f"{counted(len(reasons), 'file')} since {told(first)}, the latest {told(last)} ago: "
        f"{_why(reasons[-1])}",
        "Mend and drop them again, or `shm archive prune --quarantine-days 90`.",
    )


def check_held(examined: Examined) -> Iterator[Finding]:
    """Whether recordings wait for a person to decide."""
    found = examined.store.holds()
    if not found:
        yield ok("held", "nothing waits for you to decide")
        return
    since = told(max(examined.now - found[0].held_at, timedelta(0)))
    yield warning(
        "held",
        f"{counted(len(found), 'recording')}, the first for {since}: {found[0].file_name}",
        "See why with `shm ingest --held`, then confirm or discard each.",
    )


def check_raw_files(examined: Examined) -> Iterator[Finding]:
    """Whether the raw files of the latest recordings are where the store says."""
    store, archive = examined.store, examined.workspace.archive
    latest = store.recordings()[-_LOOKED_AT:]
    away = store.removed_to()
    missing = [r.file.file_name for r in latest if not archive.holds(r.file) and r.id not in away]
    if missing:
        yield fault(
            "raw files",
            f"{len(missing)} of the latest {len(latest)} are missing: {some(missing)}",
            "Is a disk not mounted? Else `shm archive fetch`, or restore archive/ from a backup.",
        )
    else:
        yield ok("raw files", f"the latest {len(latest)} are there")


def _without_baseline(examined: Examined) -> set[int]:
    """Hangers whose tests rightly wait until there are enough of them for a baseline."""
    wanted, selected = examined.workspace.settings.baseline_tests, examined.store.selected_models()
    latest = examined.store.latest_tests().items()
    return {id_ for id_, found in latest if id_ not in selected and found.tests < wanted}


def _age(path: Path, now: datetime) -> timedelta:
    """How long a file has been where it is; its own times come from wherever it was made."""
    try:
        since = datetime.fromtimestamp(path.lstat().st_ctime, UTC)
    except FileNotFoundError:
        return timedelta(0)
    return max(now - since, timedelta(0))


def _why(reason: Path) -> str:
    try:
        said = json.loads(reason.read_text(encoding="utf-8"))
        return f"{said['file']}: {said['message']}"
    except (OSError, ValueError, KeyError, TypeError):
        return reason.name
