"""All checks of a workspace, whatever is broken: what cannot be looked at is told, never raised.

Here are those that need no store: versions, what the settings call for, hooks and whoever else is
asked, folders, permissions, disks. Those of the store are in `doctor_checks`.
"""

from __future__ import annotations

import os
import platform
import pwd
import shutil
import sqlite3
import stat
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from datetime import datetime, timedelta
from functools import partial
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from shm import __version__
from shm.bridge import AppriseHook, Bridge, Hook, WebhookHook
from shm.errors import NothingThere, ShmError
from shm.models import competing_names
from shm.pipeline.notification_plan import quiet_until
from shm.read import sandbox
from shm.report.formatting import counted
from shm.report.paper import read_logo
from shm.settings import Settings
from shm.store import Workspace
from shm.store.point_outbox import PointOutbox
from shm.store.rows import Delivery, DeliveryState, Silence
from shm.store.stored_alerts import silenced_until
from shm.store.workspace import FOLDERS
from shm_daemon import doctor_checks as of_store
from shm_daemon.doctor_checks import Finding, Level, fault, ok, some, unknown, warning
from shm_daemon.heartbeat import NEARLY_FULL, duration_words
from shm_daemon.hooks import HookFailed, HookNotifier
from shm_daemon.web.other_bridges import ask_all

__all__ = ["Finding", "Level", "examine"]

_REMEMBERED = timedelta(days=30)  # judgement: a month, within which an operator looks here


def check_hooks(workspace: Workspace) -> Iterator[Finding]:
    """Check whether the described hooks could be run; nothing is sent. Needs no store."""
    if not workspace.bridge.hooks:
        yield warning("hooks", "none is described: nobody is told of alerts", "See docs/alerts.md.")
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


def check_publications(examined: of_store.DoctorContext) -> Iterator[Finding]:
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


def check_deliveries(examined: of_store.DoctorContext) -> Iterator[Finding]:
    """Check whether alerts wait for their hooks, or were given up."""
    store, now = examined.store, examined.now
    waiting = store.alerts.list_deliveries(DeliveryState.WAITING)
    bridge, silences = examined.workspace.bridge, store.silences.list_all()
    late = [each for each in waiting if each.attempts or _is_late(each, silences, bridge, now)]
    if late:
        worst = max(late, key=lambda each: each.attempts)
        said = worst.last_error or "not tried yet: is a daemon active?"
        yield warning(
            "deliveries",
            f"{len(late)} alerts have not reached their hook; {worst.hook}, tried "
            f"{worst.attempts} times: {said}",
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
            "See `shm alerts` for what nobody was told of, and mend the hook.",
        )
    if not late and not lost:
        yield ok("deliveries", f"{len(waiting)} on their way" if waiting else "none owed")


def _is_late(
    delivery: Delivery, silences: tuple[Silence, ...], bridge: Bridge, now: datetime
) -> bool:
    """Return True if a delivery waits long, and nothing that people asked for keeps it."""
    if any(quiet_until(delivery, bridge.hooks, at) for at in (now, now - of_store.WAITS_LONG)):
        return False
    if delivery.message_id is not None:
        return now - delivery.next_attempt_at > of_store.WAITS_LONG
    if delivery.hook in bridge.escalation_s:
        return False
    is_silenced = silenced_until(silences, delivery.alert.hanger, now) is not None
    return not is_silenced and now - delivery.stored.raised_at > of_store.WAITS_LONG


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


_CHECKS: Sequence[tuple[str, of_store.Check]] = (
    ("store", of_store.check_store),
    ("daemon", of_store.check_daemon),
    ("spool", of_store.check_spool),
    ("recordings", of_store.check_under_way),
    ("quarantine", of_store.check_quarantine),
    ("held", of_store.check_held),
    ("raw files", of_store.check_raw_files),
    ("backup", of_store.check_backup),
    ("clock", of_store.check_clock),
    ("deliveries", check_deliveries),
    ("hangers", of_store.check_hangers),
    ("streams", of_store.check_streams),
    ("publish", check_publications),
    ("settings", of_store.check_changed_settings),
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
            yield from _found(name, partial(check, of_store.DoctorContext(workspace, store, now)))


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
