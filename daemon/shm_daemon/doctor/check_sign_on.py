"""Whether people can sign in where a provider says who they are."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.util import find_spec

from shm.store import Workspace
from shm_daemon.doctor.checks import Finding, ok, warning

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
