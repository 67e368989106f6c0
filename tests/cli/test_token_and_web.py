"""`shm token` and `shm web`: who may come in over the network."""

from __future__ import annotations

from shm.store import Workspace
from tests.cli.conftest import Shm


def test_a_token_is_told_once_listed_without_its_secret_and_revoked(
    shm: Shm, empty: Workspace
) -> None:
    made = shm("--workspace", empty.folder, "token", "create", "logger", "--scope", "write")
    secret = made.out.strip()
    assert made.code == 0
    assert secret.startswith("shm_")
    listed = shm("--workspace", empty.folder, "token", "list", "--json")
    (token,) = listed.document["tokens"]
    assert (token["name"], token["scopes"]) == ("logger", ["read", "write"])
    assert secret not in listed.out + shm("--workspace", empty.folder, "token", "list").out
    assert shm("--workspace", empty.folder, "token", "create", "logger").code == 2
    assert shm("--workspace", empty.folder, "token", "revoke", "logger").code == 0
    assert shm("--workspace", empty.folder, "token", "revoke", "logger").code == 4


def test_it_does_not_open_to_others_without_a_token(shm: Shm, empty: Workspace) -> None:
    for verb in (("web",), ("daemon", "--web")):
        refused = shm("--workspace", empty.folder, *verb, "--host", "0.0.0.0")
        assert refused.code == 2
        assert "shm token create" in refused.err


def test_unit_has_the_address(shm: Shm, empty: Workspace) -> None:
    web = shm("--workspace", empty.folder, "web", "--port", 8500, "--print-unit").out
    assert "ExecStart=/usr/bin/env shm web --host 127.0.0.1 --port 8500\n" in web
    daemon = shm("--workspace", empty.folder, "daemon", "--web", "--print-unit").out
    assert "shm daemon --web --host 127.0.0.1 --port 8400\n" in daemon
