"""The container's files ask of shm only what it has: commands, variables, paths, files."""

from __future__ import annotations

import re
import shlex
import tomllib
from typing import Any
from urllib.parse import urlsplit

import pytest
import yaml

from shm.settings import TABLE
from shm_daemon.web.middleware import HEALTH
from tests.helpers.command_lines import commands, parse
from tests.helpers.pages import DOCS, ROOT

FOLDER = ROOT / "config" / "container"
COMPOSE = yaml.safe_load((FOLDER / "compose.yaml").read_text())
SERVICES: dict[str, dict[str, Any]] = COMPOSE["services"]
OURS = {name: each for name, each in SERVICES.items() if "build" in each}
CONTAINERFILE = (FOLDER / "Containerfile").read_text().replace("\\\n", " ")


def test_every_command_is_taken() -> None:
    (entry,) = re.findall(r"^ENTRYPOINT (.+)$", CONTAINERFILE, re.M)
    lines = [["shm", *each["command"]] for each in OURS.values()]
    checks = [each["healthcheck"]["test"][1:] for each in OURS.values()]
    lines += [words for words in checks if words[0] == "shm"]
    assert yaml.safe_load(entry) == ["shm"]
    assert [parse(shlex.join(words)) for words in lines] == ["shm daemon", "shm web", "shm status"]


def test_every_variable_of_ours_is_read_by_shm() -> None:
    sources = [path for room in ("shm", "daemon", "cli") for path in (ROOT / room).rglob("*.py")]
    read = {name for path in sources for name in re.findall(r'"(SHM_[A-Z_]+)"', path.read_text())}
    known = {row.environment_variable for row in TABLE} | read
    units = (path for path in (ROOT / "config").rglob("*") if path.is_file())
    named = {name for path in units for name in re.findall(r"\b(SHM_\w+)=?", path.read_text())}
    assert {"SHM_STORE", "SHM_WEB_HOSTS", "SHM_WEB_PROXIES", "SHM_CACHE"} <= named
    assert named - known == {"SHM_NAME"}  # which the comment stands in for all


def test_health_is_asked_where_it_listens_behind_our_proxy() -> None:
    web = SERVICES["web"]
    (url,) = re.findall(r'"(http://[^"]+)"', web["healthcheck"]["test"][-1])
    port = web["command"][web["command"].index("--port") + 1]
    assert urlsplit(url).path == HEALTH
    assert str(urlsplit(url).port) == port
    assert SERVICES["proxy"]["environment"]["UPSTREAM"] == f"web:{port}"
    (default,) = re.findall(r"\{\$UPSTREAM:(.+)\}", (FOLDER / "Caddyfile").read_text())
    listens = {p.name: p.default for p in dict(commands())["web"].params}
    assert default == f"{listens['host']}:{listens['port']}"
    address = SERVICES["proxy"]["networks"]["front"]["ipv4_address"]
    assert SERVICES["web"]["environment"]["SHM_WEB_PROXIES"] == address
    assert "front" not in SERVICES["daemon"].get("networks", ())
    assert "ports" not in SERVICES["web"]


@pytest.mark.parametrize("name", SERVICES)
def test_a_service_is_confined_pinned_and_watched(name: str) -> None:
    each = SERVICES[name]
    assert each["read_only"]
    assert each["cap_drop"] == ["ALL"]
    assert "/tmp" in each["tmpfs"]
    assert each["healthcheck"]["test"]
    assert re.fullmatch(r"[a-z]+:\d+\.\d+[\w.-]*", each["image"])


def test_image_is_this_version_as_a_plain_user_with_mounted_folders() -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert {each["image"] for each in OURS.values()} == {f"shm:{version}"}
    assert re.findall(r"^USER (\w+)$", CONTAINERFILE, re.M) == ["shm"]
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    (wanted,) = re.findall(r'"\.\[([\w,]+)\]"', CONTAINERFILE)
    assert set(wanted.split(",")) <= set(extras["optional-dependencies"])
    places = dict(re.findall(r"(SHM_\w+)=(\S+)", CONTAINERFILE))
    for each in OURS.values():
        mounted = {volume.rpartition(":")[2] for volume in each["volumes"]}
        assert {*places.values(), "/backup"} == mounted


def test_page_names_variables_and_commands_that_are_taken() -> None:
    asked = set(re.findall(r"\$\{(\w+)", (FOLDER / "compose.yaml").read_text()))
    page = (DOCS / "install.md").read_text()
    assert asked == set(re.findall(r"^([A-Z]+)=", page, re.M))
    called = re.findall(
        r"docker compose (?:run --rm daemon|exec (?:-T )?daemon shm) ([^`|\n]+)", page
    )
    assert len(called) == 5
    for line in called:
        assert parse(f"shm {line}").startswith("shm ")
