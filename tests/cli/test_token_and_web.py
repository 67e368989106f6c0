"""`shm token` and `shm web`: who may come in over the network."""

from __future__ import annotations

from pathlib import Path

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


def test_the_daemon_serves_https_as_the_web_interface_alone_does(
    shm: Shm, empty: Workspace, tmp_path: Path
) -> None:
    """What a warning tells to give can be given; a file that is no certificate is refused."""
    pem = tmp_path / "some.pem"
    pem.write_text("no certificate")
    for verb in (("web",), ("daemon", "--web")):
        refused = shm("--workspace", empty.folder, *verb, "--certificate", pem, "--key", pem)
        assert refused.code == 3
        assert "no certificate with a key that fits" in refused.err
        alone = shm("--workspace", empty.folder, *verb, "--key", pem)
        assert alone.code == 2
    without = shm("--workspace", empty.folder, "daemon", "--certificate", pem)
    assert without.code == 2
    assert "--web" in without.err
    given = ("daemon", "--web", "--certificate", pem, "--key", pem, "--print-unit")
    assert f"--certificate {pem} --key {pem}" in shm("--workspace", empty.folder, *given).out
    web = shm("--workspace", empty.folder, "web", "--port", 8500, *given[2:]).out
    assert f"ExecStart=/usr/bin/env shm web --host 127.0.0.1 --port 8500 --certificate {pem}" in web
