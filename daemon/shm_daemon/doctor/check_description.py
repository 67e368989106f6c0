"""Checks of what `bridge.toml` asks for: what holds instead of it, whether people can sign in
where a provider says who they are, which permanent sensors send nothing or are at fault.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib.util import find_spec

from shm.pipeline.unheard import REMEDIES, heard
from shm.report.formatting import counted
from shm.store import Workspace
from shm_daemon.doctor.checks import Examined, Finding, ok, some, warning


def check_changed_settings(examined: Examined) -> Iterator[Finding]:
    """Who reads `bridge.toml` must learn what holds instead of it."""
    changed = examined.store.settings.list_current().values()
    yield ok("settings", "; ".join(map(str, changed)) or "all as bridge.toml says")


_CHECK = "single sign-on"


def check_single_sign_on(workspace: Workspace) -> Iterator[Finding]:
    """Asks the provider what it says of itself; raises ShmError where that or our secret is off.

    Nothing where none is described, or its extra is missing, which `check_extras` says.
    """
    described = workspace.bridge.single_sign_on
    if described is None or find_spec("authlib") is None:
        return
    from shm_daemon.openid import Provider  # an extra

    Provider(described).discover()
    yield ok(_CHECK, f"{described.host} answers")
    if described.client_secret_file.stat().st_mode & 0o044:
        name = described.client_secret_file.name
        yield warning(_CHECK, f"others can read {name}", f"chmod 600 {name}")


def check_streams(examined: Examined) -> Iterator[Finding]:
    """Nothing where `bridge.toml` describes no stream."""
    found = heard(examined.workspace, examined.store, examined.now)
    for state, remedy in REMEDIES.items():
        names = [each.named for each in found if each.state == state]
        if names:
            yield warning("streams", f"{state}: {some(names)}", remedy)
    if found and not any(each.state in REMEDIES for each in found):
        yield ok("streams", f"{counted(len(found), 'stream')}, heard within the hour")
