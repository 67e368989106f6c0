"""Workspaces and the web interface before them; a file of tests puts its own history in `bridge`.

`bridge`, `site` and `client` last for a file of tests, `workspace` and what serves it for one test.
"""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from shm.store import Workspace
from shm_daemon.web.access import COOKIE
from tests.helpers.web_servers import ELSEWHERE, HTML, Served, add_a_user_of_each_role, served
from tests.helpers.workspaces import make_workspace


@pytest.fixture(scope="module")
def bridge(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    return make_workspace(tmp_path_factory.mktemp("web") / "bridge")


@pytest.fixture(scope="module")
def site(bridge: Workspace) -> Iterator[Served]:
    with served(bridge) as site:
        yield site


@pytest.fixture(scope="module")
def client(site: Served) -> Iterator[httpx.Client]:
    """Yield a person on this machine, who reads without signing in."""
    with site.client(**HTML) as client:
        yield client


@pytest.fixture
def writer(site: Served) -> Iterator[httpx.Client]:
    """Yield a browser that was signed in with a token that may write."""
    with site.client(**HTML, Origin=site.url) as client:
        client.cookies.set(COOKIE, site.write_token)
        yield client


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    return make_workspace(tmp_path / "bridge")


@pytest.fixture
def at_home(workspace: Workspace) -> Iterator[Served]:
    with served(workspace) as site:
        yield site


@pytest.fixture
def elsewhere(workspace: Workspace) -> Iterator[Served]:
    """As if it listened to the network: nobody reads without signing in."""
    with served(workspace, ELSEWHERE) as site:
        yield site


@pytest.fixture
def browser(workspace: Workspace) -> Iterator[httpx.Client]:
    """Where a user of each role may sign in; it names the origin of what it sends."""
    add_a_user_of_each_role(workspace)
    with served(workspace, ELSEWHERE) as site, site.client(Origin=site.url) as client:
        yield client


@pytest.fixture
def certificate(tmp_path: Path) -> tuple[Path, Path]:
    """Of this machine, made by nobody else; and its key."""
    pem, key = tmp_path / "certificate.pem", tmp_path / "key.pem"
    made = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2"]
    names = ["-keyout", str(key), "-out", str(pem), "-subj", "/CN=localhost"]
    alternative = ["-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1"]
    subprocess.run([*made, *names, *alternative], check=True, capture_output=True)
    return pem, key
