"""Check the work (daemon, spool, recordings, quarantine, raw files) and its store.

Also backups, clock, hangers, streams and settings.
"""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from enum import StrEnum
from pathlib import Path

from shm.pipeline.lineage import discarded_of_baselines, redescribed
from shm.pipeline.stream_health import stream_leads
from shm.report.formatting import counted
from shm.store import Stage, Store, Workspace
from shm.store.checking import of_no_recording, quick_troubles, unknown_files
from shm.store.queries.hangers import list_selected_models
from shm.store.queries.recordings import count_stages, list_holds, list_recordings, list_under_way
from shm.store.queries.tests import count_tests
from shm.store.queries.upkeep import find_last_backup, find_newest_step, list_copies, list_removed
from shm_daemon.heartbeat import duration_words, patience_s, seconds_since_beat, why_turn_failed
from shm_daemon.spool import is_sidecar, scan, unfinished_uploads, unsupported_entries

# Judgement: a step takes seconds to minutes, so that work which stands for longer than these is
# looked into; shorter ones would warn of a burst of files, longer ones hide a fault for a shift.
WAITS_LONG = timedelta(minutes=10)
"""Of a file, or an alert, that nobody takes."""
_STUCK = timedelta(hours=1)
_STUCK_BEHIND_OTHERS = timedelta(days=1)
_NOTHING_MOVES = timedelta(minutes=15)
_FORGOTTEN = timedelta(days=1)  # some uploads take hours
_ALONE = timedelta(minutes=10)  # whoever writes a sidecar first writes its file soon

_LOOKED_AT = 100  # technical: the latest files, which takes a blink; a lost disk has lost all
_FAILED = "Nothing is taken in meanwhile: mend what it names; its log tells more."
_BEGIN = "Begin it: `shm daemon`, or the service (docs/operation.md)."
_CLOCK_TOLERANCE = timedelta(minutes=1)
_SYNCHRONISED = ["timedatectl", "show", "--property=NTPSynchronized", "--value"]


class Level(StrEnum):
    """Level of a finding; `unknown` is what could not be looked at."""

    OK = "ok"
    UNKNOWN = "unknown"
    WARNING = "warning"
    FAULT = "fault"


@dataclass(frozen=True)
class Finding:
    """Finding of one check, and what to do where that is not well."""

    check: str
    level: Level
    found: str
    remedy: str = ""


@dataclass(frozen=True)
class DoctorContext:
    """Subject of the checks: an open workspace with its open store, and the time."""

    workspace: Workspace
    store: Store
    now: datetime


Check = Callable[[DoctorContext], Iterator[Finding]]
"""A check of a store that can be read; it may raise ShmError and OSError, which become findings."""


def ok(check: str, found: str) -> Finding:
    """All is well."""
    return Finding(check, Level.OK, found)


def warning(check: str, found: str, remedy: str) -> Finding:
    """Work goes on; somebody should look."""
    return Finding(check, Level.WARNING, found, remedy)


def fault(check: str, found: str, remedy: str) -> Finding:
    """Work cannot go on as it should."""
    return Finding(check, Level.FAULT, found, remedy)


def unknown(check: str, found: str, remedy: str = "") -> Finding:
    """It could not be looked at."""
    return Finding(check, Level.UNKNOWN, found, remedy)


def some(names: list[str], most: int = 5) -> str:
    """The first of many names."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def check_daemon(examined: DoctorContext) -> Iterator[Finding]:
    """Check whether a daemon is active, and its loop goes round."""
    workspace = examined.workspace
    holder, ago_s = workspace.holder(), seconds_since_beat(workspace)
    seen = (
        "never seen here"
        if ago_s is None
        else f"last seen {duration_words(timedelta(seconds=ago_s))} ago"
    )
    if holder is None:
        yield warning("daemon", f"none is active, {seen}", _BEGIN)
    elif ago_s is None or ago_s > patience_s(workspace):
        yield warning(
            "daemon",
            f"{holder} holds the store, but a daemon's loop was {seen}",
            "If that is no `shm ingest` or `shm db` at work, the daemon hangs: begin it again.",
        )
    elif failed := why_turn_failed(workspace):
        yield fault("daemon", f"{holder} is active, but its last turn failed: {failed}", _FAILED)
    else:
        yield ok("daemon", f"{holder} is active, {seen}")


def check_spool(examined: DoctorContext) -> Iterator[Finding]:
    """Check whether files wait in the spool, or lie there for ever."""
    spool = examined.workspace.spool
    ages = [_age(path, examined.now) for path in scan(spool)]
    if not ages:
        yield ok("spool", "empty")
    else:
        found = (
            f"{counted(len(ages), 'file')} in the queue, the oldest for {duration_words(max(ages))}"
        )
        late = max(ages) > WAITS_LONG
        remedy = "Is a daemon active, and what does its log say of these files?"
        yield warning("spool", found, remedy) if late else ok("spool", found)
    never = unsupported_entries(spool)
    if never:
        named = [f"{path.relative_to(spool)} is {what}" for path, what in sorted(never.items())]
        yield warning(
            "spool",
            f"never taken: {some(named)}",
            "Only files are taken: put the file itself there, readable by the daemon's user.",
        )
    left = [(path, _age(path, examined.now)) for path in unfinished_uploads(spool)]
    sidecars = [path.name for path, age in left if is_sidecar(path) and age > _ALONE]
    if sidecars:
        yield warning(
            "spool",
            f"sidecars without their file: {some(sidecars)}",
            "One that came after its file says nothing: drop that file again beside it.",
        )
    broken = [p.name for p, age in left if p.name not in sidecars and age > _FORGOTTEN]
    if broken:
        yield warning(
            "spool",
            f"uploads that broke off more than a day ago: {some(broken)}",
            "Send them again, or delete them.",
        )


def check_under_way(examined: DoctorContext) -> Iterator[Finding]:
    """Check whether a recording has been standing still."""
    store, now = examined.store, examined.now
    unready = _without_baseline(examined)
    standing = [
        each
        for each in list_under_way(store)
        if each.stage is Stage.RECEIVED or each.hanger not in unready
    ]
    if not standing:
        yield ok("recordings", "none is on its way")
        return
    oldest = min(standing, key=lambda each: each.since)
    newest_at = find_newest_step(store) or now
    waits, idle = now - oldest.since, now - newest_at
    found = (
        f"{len(standing)} on their way; {oldest.file_name} (recording {oldest.id}) has been "
        f"{oldest.stage} for {duration_words(waits)}"
    )
    if waits > _STUCK_BEHIND_OTHERS or (waits > _STUCK and idle > _NOTHING_MOVES):
        remedy = f"See the daemon's log, then `shm ingest --again {oldest.id}`."
        yield warning("recordings", found, remedy)
    else:
        yield ok("recordings", found)


def check_quarantine(examined: DoctorContext) -> Iterator[Finding]:
    """Check which files were refused, and since when."""
    folder = examined.workspace.quarantine.folder
    reasons = sorted(folder.glob("*.reason.json"), key=lambda path: path.stat().st_mtime)
    if not reasons:
        yield ok("quarantine", "empty")
        return
    first, last = (_age(path, examined.now) for path in (reasons[0], reasons[-1]))
    try:
        document = json.loads(reasons[-1].read_text(encoding="utf-8"))
        why = f"{document['file']}: {document['message']}"
    except (OSError, ValueError, KeyError, TypeError):
        why = reasons[-1].name
    yield warning(
        "quarantine",
        f"{counted(len(reasons), 'file')} since {duration_words(first)},"
        f" the latest {duration_words(last)} ago: {why}",
        "Mend and drop them again, or `shm archive prune --quarantine-days 90`.",
    )


def check_held(examined: DoctorContext) -> Iterator[Finding]:
    """Check whether recordings wait for a person to decide."""
    found = list_holds(examined.store)
    if not found:
        yield ok("held", "nothing waits for you to decide")
        return
    since = duration_words(max(examined.now - found[0].held_at, timedelta(0)))
    yield warning(
        "held",
        f"{counted(len(found), 'recording')}, the first for {since}: {found[0].file_name}",
        "See why with `shm ingest --held`, then confirm or discard each.",
    )


def check_raw_files(examined: DoctorContext) -> Iterator[Finding]:
    """Check whether the raw files of the latest recordings are where the store says."""
    store, archive = examined.store, examined.workspace.archive
    latest = list_recordings(store)[-_LOOKED_AT:]
    away = list_removed(store)
    missing = [r.file.file_name for r in latest if not archive.holds(r.file) and r.id not in away]
    if missing:
        yield fault(
            "raw files",
            f"{len(missing)} of the latest {len(latest)} are missing: {some(missing)}",
            "Is a disk not mounted? Else `shm archive fetch`, or restore archive/ from a backup.",
        )
    else:
        yield ok("raw files", f"the latest {len(latest)} are there")
    if names := unknown_files(store, archive):
        yield warning("raw files", *of_no_recording(names))


def _without_baseline(examined: DoctorContext) -> set[int]:
    """Hangers whose tests rightly wait until there are enough of them for a baseline."""
    wanted = examined.workspace.settings.baseline_tests
    selected = list_selected_models(examined.store)
    latest = count_tests(examined.store).items()
    return {id_ for id_, found in latest if id_ not in selected and found.tests < wanted}


def _age(path: Path, now: datetime) -> timedelta:
    """Return how long a file has been where it is; its own times come from wherever it was made."""
    try:
        since = datetime.fromtimestamp(path.lstat().st_ctime, UTC)
    except FileNotFoundError:
        return timedelta(0)
    return max(now - since, timedelta(0))


def check_store(examined: DoctorContext) -> Iterator[Finding]:
    """Check whether the store is whole, as far as a quick look tells."""
    store = examined.store
    troubles = quick_troubles(store)
    if troubles:
        yield fault(
            "store",
            f"{store.location} is damaged: {some(list(troubles))}",
            "Stop the daemon, then `shm db restore FILE --replace`.",
        )
    else:
        held = sum(count_stages(store).values())
        kind = store.engine.dialect.name
        yield ok(
            "store", f"{store.location} ({kind}), present schema, {counted(held, 'recording')}"
        )


def check_backup(examined: DoctorContext) -> Iterator[Finding]:
    """Check how old the last backup is, and how many raw files have no copy."""
    store, now = examined.store, examined.now
    last = find_last_backup(store)
    remedy = "`shm db backup FILE --archive DIR`, best every night."
    if last is None:
        yield warning("backup", "never made here", remedy)
    else:
        found = f"{last[1]}, {duration_words(now - last[0])} ago"
        late = now - last[0] > timedelta(days=examined.workspace.settings.backup_days)
        yield warning("backup", found, remedy) if late else ok("backup", found)
    copied = {copy.recording_id for copy in list_copies(store)}
    alone = sum(recording.id not in copied for recording in list_recordings(store))
    if last is not None and alone:
        yield warning("backup", f"raw files without a copy elsewhere: {alone}", remedy)


def check_clock(examined: DoctorContext) -> Iterator[Finding]:
    """Check whether the clock has jumped back, and whether anything sets it."""
    newest, now = find_newest_step(examined.store), examined.now
    if newest is not None and newest - now > _CLOCK_TOLERANCE:
        yield fault(
            "clock",
            f"it says {now:%Y-%m-%d %H:%M} UTC, "
            f"{duration_words(newest - now)} before the newest row",
            "Set it; tests without a time of their own are dated by it.",
        )
    said = _synchronised()
    if said is None:
        yield unknown("clock", "whether anything sets it cannot be told here")
    elif said:
        yield ok("clock", "synchronised")
    else:
        yield warning("clock", "not synchronised", "`timedatectl set-ntp true`.")


def check_hangers(examined: DoctorContext) -> Iterator[Finding]:
    """Check which hangers have no test, none lately, or no baseline."""
    store, bridge = examined.store, examined.workspace.bridge
    settings, latest = examined.workspace.settings, count_tests(store)
    selected = list_selected_models(store)
    ids = [hanger.id for hanger in bridge.hangers]
    never = [str(each) for each in ids if each not in latest]
    before = examined.now - timedelta(days=settings.quiet_days)
    quiet = [str(each) for each in ids if each in latest and latest[each].time < before]
    forming = [
        f"{each} ({latest[each].tests} of {settings.baseline_tests} tests)"
        for each in ids
        if each in latest and each not in selected
    ]
    if quiet:
        yield warning(
            "hangers",
            f"no test for {settings.quiet_days:g} days: {some(quiet)}",
            "Test them, or raise quiet_days.",
        )
    if never:
        yield warning("hangers", f"no test yet: {some(never)}", "Test them.")
    if forming:
        yield warning("hangers", f"no baseline yet: {some(forming)}", "Take more tests.")
    outdated = list(_outdated_baselines(examined))
    yield from outdated
    strangers = sorted(set(latest) - {each.id for each in bridge.watched})
    if strangers:
        names = some([str(each) for each in strangers])
        yield warning(
            "hangers", f"tests of hangers not described: {names}", "Describe them in bridge.toml."
        )
    if not (quiet or never or forming or outdated or strangers):
        yield ok("hangers", f"{len(ids)}, with a baseline and recent tests")


def _outdated_baselines(examined: DoctorContext) -> Iterator[Finding]:
    """Baselines that are not what they were made from any more."""
    store = examined.store
    baselines = [
        (each, store.watch.baseline(each.id)) for each in examined.workspace.bridge.hangers
    ]
    changed = [str(each.id) for each, made in baselines if redescribed(each, made)]
    discarded = discarded_of_baselines(store)
    gone = [str(each.id) for each, _ in baselines if each.id in discarded]
    for hangers, found in (
        (changed, "described otherwise since the baseline"),
        (gone, "baseline made from a test that was discarded"),
    ):
        if hangers:
            anew = f"shm drift rebaseline --hanger {hangers[0]} --since DAY --why TEXT"
            yield warning("hangers", f"{found}: {some(hangers)}", f"Set a new baseline: `{anew}`.")


def check_streams(examined: DoctorContext) -> Iterator[Finding]:
    """Find streams that say nothing or are not read; nothing where none is described."""
    leads = stream_leads(examined.workspace, examined.store, examined.now)
    yield from (warning("streams", lead.state.rstrip("."), lead.action) for lead in leads)
    if (streams := examined.workspace.bridge.streams) and not leads:
        yield ok("streams", f"{counted(len(streams), 'stream')}, heard within the hour")


def check_changed_settings(examined: DoctorContext) -> Iterator[Finding]:
    """List settings that hold instead of `bridge.toml`: who reads it must learn of them."""
    changed = examined.store.settings.list_current().values()
    yield ok("settings", "; ".join(map(str, changed)) or "all as bridge.toml says")


def _synchronised() -> bool | None:
    """Return True if a service keeps the clock right; None where nobody can tell."""
    if shutil.which(_SYNCHRONISED[0]) is None:
        return None
    try:
        ended = subprocess.run(  # noqa: S603 - no word of it is anybody's input
            _SYNCHRONISED, capture_output=True, text=True, timeout=5, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return {"yes": True, "no": False}.get(ended.stdout.strip())
