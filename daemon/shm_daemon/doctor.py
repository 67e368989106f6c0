"""All checks of a workspace, whatever is broken: what cannot be looked at is told, never raised."""

from __future__ import annotations

import json
import os
import platform
import pwd
import shutil
import sqlite3
import stat
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from enum import StrEnum
from functools import partial
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from shm import __version__
from shm.bridge import AppriseHook, Bridge, Hook, WebhookHook, example_words
from shm.errors import NothingThere, ShmError
from shm.models import competing_names
from shm.pipeline.courier import quiet_until
from shm.pipeline.lineage import discarded_of_baselines, redescribed
from shm.pipeline.stream_health import heard, stream_leads
from shm.read import sandbox
from shm.report.formatting import counted
from shm.report.paper import read_logo
from shm.settings import Settings
from shm.store import Stage, Store, Workspace
from shm.store.alerts import silenced_until
from shm.store.backups import of_no_recording, quick_troubles, unknown_files
from shm.store.point_outbox import PointOutbox
from shm.store.recordings import count_stages, list_holds, list_recordings, list_under_way
from shm.store.rows import Delivery, DeliveryState, Silence
from shm.store.tests import count_tests
from shm.store.upkeep import find_last_backup, find_newest_step, list_copies, list_removed
from shm.store.watch import list_selected_models
from shm.store.workspace import FOLDERS
from shm_daemon.heartbeat import (
    NEARLY_FULL,
    duration_words,
    patience_s,
    seconds_since_beat,
    why_turn_failed,
)
from shm_daemon.hooks import HookFailed, HookNotifier
from shm_daemon.spool import is_sidecar, scan, unfinished_uploads, unsupported_entries
from shm_daemon.web.other_bridges import ask_all

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
_FAILED = "No file is processed until you fix what it names; see its log."
_START = "Start it: `shm daemon`, or the service (docs/operation.md)."
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
        yield warning("daemon", f"none is active, {seen}", _START)
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
        (each, since)
        for each, since in list_under_way(store)
        if each.stage is Stage.RECEIVED or each.hanger not in unready
    ]
    if not standing:
        yield ok("recordings", "none pending")
        return
    oldest, since = min(standing, key=lambda each: each[1])
    newest_at = find_newest_step(store) or now
    waits, idle = now - since, now - newest_at
    found = (
        f"{len(standing)} on their way; {oldest.file.file_name} (recording {oldest.id}) has been "
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
        "Mend them and drop them again, or delete them: the archive has what was read of them.",
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
    is_synchronised = _synchronised()
    if is_synchronised is None:
        yield unknown("clock", "cannot check whether the clock is synchronised (NTP)")
    elif is_synchronised:
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
    examples = [words for each in bridge.hangers if (words := example_words(each))]
    for words in examples:
        yield warning("hangers", *words.split(": ", 1))
    strangers = sorted(set(latest) - {each.id for each in bridge.watched})
    if strangers:
        names = some([str(each) for each in strangers])
        yield warning(
            "hangers", f"tests of hangers not described: {names}", "Describe them in bridge.toml."
        )
    if not (quiet or never or forming or outdated or examples or strangers):
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
            command = f"shm drift rebaseline --hanger {hangers[0]} --since DAY --why TEXT"
            yield warning(
                "hangers", f"{found}: {some(hangers)}", f"Set a new baseline: `{command}`."
            )


def check_streams(examined: DoctorContext) -> Iterator[Finding]:
    """Find streams that say nothing or are not read; nothing where none is described."""
    leads = stream_leads(heard(examined.workspace, examined.store, examined.now))
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


__all__ = ["Finding", "Level", "examine"]

_REMEMBERED = timedelta(days=30)  # judgement: a month, within which an operator looks here


def check_hooks(workspace: Workspace) -> Iterator[Finding]:
    """Check whether the described hooks could be run; nothing is sent. Needs no store."""
    if not workspace.bridge.hooks:
        yield warning("hooks", "none is described: nobody receives alerts", "See docs/alerts.md.")
    timeout_s = workspace.settings.hook_timeout_seconds
    notifier = HookNotifier(workspace.folder, timeout_s, os.environ)
    try:
        for hook in workspace.bridge.hooks:
            yield _ready(notifier, hook)
            secret = hook.secret_file if isinstance(hook, WebhookHook) else ""
            secret = hook.address_file if isinstance(hook, AppriseHook) else secret
            yield from _secrecy(workspace, f"hook {hook.name}", secret)
    finally:
        notifier.close()


def check_single_sign_on(workspace: Workspace) -> Iterator[Finding]:
    """Asks the provider what it says of itself; raises ShmError where that or our secret is off.

    Nothing where none is described, or its extra is missing, which `check_extras` says.
    """
    described = workspace.bridge.single_sign_on
    if described is None or find_spec("authlib") is None:
        return
    from shm_daemon.openid import Provider  # an extra

    Provider(described).discover()
    yield ok("single sign-on", f"{described.host} answers")
    yield from _secrecy(workspace, "single sign-on", str(described.client_secret_file))
    with suppress(NothingThere), workspace.store() as store:
        people = [each for each in store.people.list_all() if each.removed_at is None]
        if people and not any(each.single_sign_on for each in people):
            yield warning(
                "single sign-on",
                "all users have a password: it lets nobody in",
                "shm user single-sign-on NAME",
            )


def check_other_bridges(workspace: Workspace) -> Iterator[Finding]:
    """Check whether the dashboards of other bridges answer; nothing where none is named."""
    others = workspace.bridge.other_bridges
    for other, row in zip(others, ask_all(others, workspace.folder), strict=True):
        check = f"bridge {other.name}"
        if row.trouble:
            yield warning(check, row.trouble.state, row.trouble.action)
        else:
            yield ok(check, other.address)
        yield from _secrecy(workspace, check, other.token_file)


def check_publications(examined: DoctorContext) -> Iterator[Finding]:
    """Find databases that do not take the results; nothing where `bridge.toml` names none."""
    workspace = examined.workspace
    outbox = PointOutbox(workspace.folder)
    for each in workspace.bridge.publications:
        check, state = f"publish {each.name}", outbox.state(each.name)
        if state.refused or state.why:
            remedy = "The daemon tries again each minute, and sends what waits once it is taken."
            yield warning(check, state.words or state.why, remedy)
        else:
            yield ok(check, f"{each.url}: {state.waiting} points wait")
        yield from _secrecy(workspace, check, each.token_file)


def check_logo(workspace: Workspace) -> Iterator[Finding]:
    """Check whether the logo of the reports can be read; nothing where none is named."""
    path = workspace.bridge.letterhead.logo
    if why := read_logo(path).fault:
        yield warning("logo", f"reports are made w{why[1:]}", f"Put it at {path}.")
    elif path:
        yield ok("logo", path.name)


def check_deliveries(examined: DoctorContext) -> Iterator[Finding]:
    """Check whether alerts wait for their hooks, or were given up."""
    store, now = examined.store, examined.now
    waiting = store.alerts.list_deliveries(DeliveryState.WAITING)
    bridge, silences = examined.workspace.bridge, store.silences.list_all()
    late = [each for each in waiting if each.attempts or _is_late(each, silences, bridge, now)]
    if late:
        worst = max(late, key=lambda each: each.attempts)
        reason = worst.last_error or "not tried yet: is a daemon active?"
        yield warning(
            "deliveries",
            f"{len(late)} alerts have not reached their hook; {worst.hook}, tried "
            f"{worst.attempts} times: {reason}",
            f"`shm alerts test --hook {worst.hook}`; they are tried again by themselves.",
        )
    ended = store.alerts.list_deliveries(DeliveryState.GIVEN_UP)
    lost = [each for each in ended if each.ended_at and now - each.ended_at < _REMEMBERED]
    if lost:
        last = lost[-1]
        yield warning(
            "deliveries",
            f"{len(lost)} were given up in the last {duration_words(_REMEMBERED)}; {last.hook}: "
            f"{last.last_error}",
            "`shm alerts` lists them. Fix the hook, then run `shm alerts resend NUMBER`.",
        )
    if not late and not lost:
        yield ok("deliveries", f"{len(waiting)} pending" if waiting else "none due")


def _is_late(
    delivery: Delivery, silences: tuple[Silence, ...], bridge: Bridge, now: datetime
) -> bool:
    """Return True if a delivery waits long, and nothing that people asked for keeps it."""
    if any(quiet_until(delivery, bridge.hooks, at) for at in (now, now - WAITS_LONG)):
        return False
    if delivery.message_id is not None:
        return now - delivery.next_attempt_at > WAITS_LONG
    if delivery.hook in bridge.escalation_s:
        return False
    is_silenced = silenced_until(silences, delivery.alert.hanger, now) is not None
    return not is_silenced and now - delivery.stored.raised_at > WAITS_LONG


def _ready(notifier: HookNotifier, hook: Hook) -> Finding:
    check = f"hook {hook.name}"
    try:
        return ok(check, notifier.ready(hook))
    except HookFailed as error:
        if isinstance(hook, WebhookHook) and hook.secret_env:
            # The daemon's environment may hold what ours does not.
            return unknown(check, error.message, "Try it as the daemon's user, with its variables.")
        return fault(check, error.message, error.remedy)


def _secrecy(workspace: Workspace, check: str, name: str) -> Iterator[Finding]:
    path = workspace.folder / name
    if name and path.exists() and path.stat().st_mode & (stat.S_IRGRP | stat.S_IROTH):
        shown = os.path.relpath(path, workspace.folder)
        yield warning(check, f"others can read {shown}", f"chmod 600 {path}")


_CHECKS: Sequence[tuple[str, Check]] = (
    ("store", check_store),
    ("daemon", check_daemon),
    ("spool", check_spool),
    ("recordings", check_under_way),
    ("quarantine", check_quarantine),
    ("held", check_held),
    ("raw files", check_raw_files),
    ("backup", check_backup),
    ("clock", check_clock),
    ("deliveries", check_deliveries),
    ("hangers", check_hangers),
    ("streams", check_streams),
    ("publish", check_publications),
    ("settings", check_changed_settings),
)
_REPORT = "This is a fault of shm; please report it."


def examine(folder: Path, now: datetime) -> tuple[Finding, ...]:
    """Run all checks of a workspace; those that need what is broken are left out."""
    folder = folder.resolve()
    findings = [*_found("versions", check_versions)]
    if not folder.is_dir():
        return (*findings, fault("folders", f"{folder} is no folder", "Make it with `shm init`."))
    findings += _found("folders", partial(check_folders, folder))
    try:
        workspace = Workspace.described(folder)
    except (ShmError, OSError) as error:
        return (*findings, _broken("bridge.toml", error))
    described = f"{workspace.bridge.name}, {counted(len(workspace.bridge.hangers), 'hanger')}"
    findings.append(ok("bridge.toml", described))
    checks: dict[str, Callable[[], Iterable[Finding]]] = {
        "disk": partial(check_disks, folder, workspace.settings),
        "models": partial(check_models, workspace),
        "extras": partial(check_extras, workspace),
        "confinement": check_confinement,
        "logo": partial(check_logo, workspace),
        "hooks": partial(check_hooks, workspace),
        "single sign-on": partial(check_single_sign_on, workspace),
        "bridges": partial(check_other_bridges, workspace),
    }
    for name, check in checks.items():
        findings += _found(name, check)
    return (*findings, *_of_store(workspace, now))


def _of_store(workspace: Workspace, now: datetime) -> Iterator[Finding]:
    try:
        store = workspace.store()
    except (ShmError, OSError) as error:
        yield _broken("store", error)
        yield unknown("flow", "what needs the store was not looked at", "Mend the store first.")
        return
    with store:
        for name, check in _CHECKS:
            yield from _found(name, partial(check, DoctorContext(workspace, store, now)))


def _found(name: str, check: Callable[[], Iterable[Finding]]) -> list[Finding]:
    try:
        return list(check())
    except (ShmError, OSError) as error:
        return [_broken(name, error)]
    except Exception as error:  # noqa: BLE001 - one check that fails must not hide the others
        return [unknown(name, f"{type(error).__name__}: {error}", _REPORT)]


def _broken(name: str, error: ShmError | OSError) -> Finding:
    if isinstance(error, ShmError):
        where = f"{error.where}: " if error.where else ""
        return fault(name, f"{where}{error.message}", error.remedy)
    denied = isinstance(error, PermissionError)
    remedy = "Let this user in." if denied else "Mend or remove what it names."
    return fault(name, f"{error.filename or ''}: {error.strerror or error}", remedy)


_MODULES = {
    "alerts": ("apprise",),
    "distributed": ("distributed",),
    "mqtt": ("paho",),
    "postgres": ("psycopg",),
    "seedlink": ("seedlink_client",),
    "sso": ("authlib",),
    "web": ("fastapi", "prometheus_client", "uvicorn"),
}
_SHOWN = ("numpy", "scipy", "sqlalchemy")


def check_versions() -> Iterator[Finding]:
    """List the versions on which results depend."""
    libraries = ", ".join(f"{name} {version(name)}" for name in _SHOWN)
    yield ok(
        "versions",
        f"shm {__version__}, Python {platform.python_version()}, {libraries}, "
        f"SQLite {sqlite3.sqlite_version}",
    )


def check_extras(workspace: Workspace) -> Iterator[Finding]:
    """Check whether what the settings call for is installed."""
    installed = [extra for extra, modules in _MODULES.items() if all(map(find_spec, modules))]
    settings, hooks = workspace.settings, workspace.bridge.hooks
    needed = {
        "alerts": any(isinstance(hook, AppriseHook) for hook in hooks),
        "distributed": bool(settings.scheduler),
        "mqtt": bool(settings.mqtt_url),
        "postgres": "://" in settings.store,
        "seedlink": any(each.feed is not None for each in workspace.bridge.streams),
        "sso": workspace.bridge.single_sign_on is not None,
    }
    missing = [extra for extra, wanted in needed.items() if wanted and extra not in installed]
    if missing:
        names = ",".join(missing)
        yield fault("extras", f"not installed: {names}", f"pip install 'shm[{names}]'")
    else:
        yield ok("extras", f"installed: {', '.join(installed) or 'none'}; none other is needed")


def check_models(workspace: Workspace) -> Iterator[Finding]:
    """Check whether each hanger has a model class; raises UsageError, as the daemon does."""
    names = workspace.settings.model_names
    for hanger in workspace.bridge.hangers:
        competing_names(hanger, names)
    yield ok("models", f"{', '.join(names)}; each hanger has one that applies")


def check_confinement() -> Iterator[Finding]:
    """Check whether files of others are read within all bounds that we know.

    Raises ShmError where they cannot. A file is read by a child process here, as the daemon's are.
    """
    missing = sandbox.missing_bounds()
    for name, why in missing.items():
        yield warning(
            "confinement",
            f"files are read without {name}: {why}",
            "A damaged file may fill the memory of this computer: run shm on Linux.",
        )
    if not missing:
        yield ok("confinement", "each file is read in a process with limits of time and memory")


def check_folders(folder: Path) -> Iterator[Finding]:
    """Check whether the folders of a workspace are there and we may write in them."""
    missing = [name for name in FOLDERS if not (folder / name).is_dir()]
    if missing:
        yield fault(
            "folders",
            f"{some(missing)} missing in {folder}",
            "Is a disk not mounted? Else the next command makes them, empty.",
        )
    wanted = [folder, *(folder / name for name in FOLDERS if name not in missing)]
    closed = [path for path in wanted if not os.access(path, os.R_OK | os.W_OK | os.X_OK)]
    if closed:
        yield fault(
            "permissions",
            f"this user cannot write in {some([str(path) for path in closed])}",
            "Give the folders to the user who runs the daemon: chown -R.",
        )
    yield from _owner(folder)
    if not missing and not closed:
        yield ok("folders", str(folder))


def _owner(folder: Path) -> Iterator[Finding]:
    owner, ours = folder.stat().st_uid, os.geteuid()
    if owner != ours:
        yield warning(
            "permissions",
            f"the folder belongs to user {_name(owner)}, this is user {_name(ours)}",
            f"Ask as that user, who sees what the daemon sees: sudo -u {_name(owner)} shm doctor.",
        )
    described = folder / "bridge.toml"
    if described.exists() and described.stat().st_mode & stat.S_IWOTH:
        yield fault(
            "permissions",
            "everybody can change bridge.toml, and so the programs that hooks run",
            f"chmod o-w {described}",
        )


def check_disks(folder: Path, settings: Settings) -> Iterator[Finding]:
    """Check whether there is room wherever we write."""
    places = {
        "workspace": folder,
        "archive": folder / "archive",
        "temporary files": Path(tempfile.gettempdir()),
    }
    seen: set[int] = set()
    for what, path in places.items():
        if path.exists() and path.stat().st_dev not in seen:
            seen.add(path.stat().st_dev)
            yield _room(what, path, settings.min_free_bytes)


def _room(what: str, path: Path, wanted_bytes: int) -> Finding:
    usage = shutil.disk_usage(path)
    found = f"{what}: {usage.free / 1e9:.1f} of {usage.total / 1e9:.0f} GB free"
    remedy = "Free some space; `shm archive prune --dry-run` says what could go."
    if usage.free < NEARLY_FULL * wanted_bytes:
        return fault("disk", found, remedy)
    if usage.free < wanted_bytes:
        return warning("disk", found, remedy)
    return ok("disk", found)


def _name(user: int) -> str:
    try:
        return pwd.getpwuid(user).pw_name
    except KeyError:
        return str(user)
