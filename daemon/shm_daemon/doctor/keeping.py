"""Whether store, backups, clock and hangers are in order."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from datetime import timedelta

from shm.pipeline.redescribed import redescribed
from shm.report.words import counted
from shm.store.checking import quick_troubles
from shm_daemon.doctor.contract import (
    Examined,
    Finding,
    fault,
    ok,
    some,
    unknown,
    warning,
)
from shm_daemon.heartbeat import told

_CLOCK_TOLERANCE = timedelta(minutes=1)
_SYNCHRONISED = ["timedatectl", "show", "--property=NTPSynchronized", "--value"]


def check_store(examined: Examined) -> Iterator[Finding]:
    """Whether the store is whole, as far as a quick look tells."""
    store = examined.store
    troubles = (*quick_troubles(store), *(error.message for error in store.known_damage()))
    if troubles:
        yield fault(
            "store",
            f"{store.location} is damaged: {some(list(troubles))}",
            "`shm db check` names each damaged row and what heals it; else stop the daemon, then "
            "`shm db restore FILE --replace`.",
        )
    else:
        held = sum(store.stage_counts().values())
        kind = store.engine.dialect.name
        yield ok(
            "store", f"{store.location} ({kind}), present schema, {counted(held, 'recording')}"
        )


def check_backup(examined: Examined) -> Iterator[Finding]:
    """How old the last backup is, and how many raw files have no copy."""
    store, now = examined.store, examined.now
    last, remedy = store.last_backup(), "`shm db backup FILE --archive DIR`, best every night."
    if last is None:
        yield warning("backup", "never made here", remedy)
    else:
        found = f"{last[1]}, {told(now - last[0])} ago"
        late = now - last[0] > timedelta(days=examined.workspace.settings.backup_days)
        yield warning("backup", found, remedy) if late else ok("backup", found)
    copied = {copy.recording_id for copy in store.archive_copies()}
    alone = sum(recording.id not in copied for recording in store.recordings())
    if last is not None and alone:
        yield warning("backup", f"raw files without a copy elsewhere: {alone}", remedy)


def check_clock(examined: Examined) -> Iterator[Finding]:
    """Whether the clock has jumped back, and whether anything sets it."""
    newest, now = examined.store.newest_row_at(), examined.now
    if newest is not None and newest - now > _CLOCK_TOLERANCE:
        yield fault(
            "clock",
            f"it says {now:%Y-%m-%d %H:%M} UTC, {told(newest - now)} before the newest row",
            "Set it; tests without a time of their own are dated by it.",
        )
    said = _synchronised()
    if said is None:
        yield unknown("clock", "whether anything sets it cannot be told here")
    elif said:
        yield ok("clock", "synchronised")
    else:
        yield warning("clock", "not synchronised", "`timedatectl set-ntp true`.")


def check_hangers(examined: Examined) -> Iterator[Finding]:
    """Which hangers have no test, none lately, or no baseline."""
    store, bridge = examined.store, examined.workspace.bridge
    settings, latest, selected = (
        examined.workspace.settings,
        store.latest_tests(),
        store.selected_models(),
    )
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
    changed = [
        str(each.id) for each in bridge.hangers if redescribed(each, store.baseline(each.id))
    ]
    if changed:
        yield warning(
            "hangers",
            f"described otherwise since the baseline: {some(changed)}",
            f"Set a new baseline: `shm drift rebaseline --hanger {changed[0]} --since DAY --why "
            "TEXT`.",
        )
    strangers = sorted(set(latest) - set(ids))
    if strangers:
        names = some([str(each) for each in strangers])
        yield warning(
            "hangers", f"tests of hangers not described: {names}", "Describe them in bridge.toml."
        )
    if not (quiet or never or forming or changed or strangers):
        yield ok("hangers", f"{len(ids)}, with a baseline and recent tests")


def _synchronised() -> bool | None:
    """Whether a service keeps the clock right; None where nobody can tell."""
    if shutil.which(_SYNCHRONISED[0]) is None:
        return None
    try:
        ended = subprocess.run(  # noqa: S603 - no word of it is anybody's input
            _SYNCHRONISED, capture_output=True, text=True, timeout=5, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return {"yes": True, "no": False}.get(ended.stdout.strip())
