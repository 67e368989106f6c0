"""A `bridge.toml` with a fault: the work goes on with the one before, and everybody is told."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from shm.errors import BadInput
from shm.pipeline import utc_now
from shm.store import Workspace
from shm_daemon.doctor import Level, examine
from shm_daemon.heartbeat import beat
from shm_daemon.web.frame import NAVIGATION
from tests.helpers.workspaces import make_workspace
from tests.store.make_released_database import fill

LENGTH = "length_m = 12.0"
FAULTS = {
    "syntax": (LENGTH, "length_m = = 12.0", 7, "not a readable TOML file"),
    "unknown key": (LENGTH, "lenght_m = 12.0", 7, "unknown key lenght_m"),
    "no number": (LENGTH, 'length_m = "12 m"', 7, "length_m = '12 m' is not a positive number"),
    "missing key": (f"{LENGTH}\n", "", 4, "length_m is missing"),
    "unknown setting": ("samples = 100", "sampels = 100", None, "unknown setting 'sampels'"),
}
PAGES = ("/hangers/3", *(address for address, _ in NAVIGATION))


@pytest.fixture(scope="module")
def bridge(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    workspace = make_workspace(tmp_path_factory.mktemp("description") / "bridge", hangers=(3, 4, 5))
    with workspace.store() as store:
        fill(store)
    return workspace


@pytest.fixture
def described(bridge: Workspace) -> Iterator[Path]:
    """Its bridge.toml, which is as it was again after the test."""
    path = bridge.folder / "bridge.toml"
    before = path.read_text()
    beat(bridge)
    yield path
    path.write_text(before)


@pytest.mark.parametrize(("old", "new", "line", "said"), FAULTS.values(), ids=FAULTS)
def test_health_pages_and_doctor_say_what_is_wrong_and_where(
    client: httpx.Client,
    bridge: Workspace,
    described: Path,
    old: str,
    new: str,
    line: int | None,
    said: str,
) -> None:
    sound = client.get("/health").json()
    assert (sound["status"], sound["reasons"]) == ("ok", [])
    assert 'class="problem notice"' not in client.get("/").text
    described.write_text(described.read_text().replace(old, new, 1))
    place = f"bridge.toml, line {line}: " if line else "bridge.toml: "

    answer = client.get("/health")
    assert answer.status_code == 200
    assert answer.json()["status"] == "degraded"
    (reason,) = answer.json()["reasons"]
    assert reason.startswith(place)
    assert said in reason
    assert "still in force" in reason
    assert str(bridge.folder) not in reason

    for path in PAGES:
        page = client.get(path)
        assert page.status_code == 200, path
        notice = page.text.split('class="problem notice"')[1].split("</div>")[0]
        assert place in notice
        assert said.replace("'", "&#39;") in notice
        assert "</strong> " in notice  # and what to do

    (found,) = [each for each in examine(bridge.folder, utc_now()) if each.check == "bridge.toml"]
    assert found.level is Level.FAULT
    assert found.found.startswith(place)
    assert found.remedy


def test_lost_file_or_hanger(client: httpx.Client, described: Path, bridge: Workspace) -> None:
    before = described.read_text()
    described.unlink()
    answer = client.get("/health").json()
    page = client.get("/").text
    described.write_text(before)
    assert answer["status"] == "degraded"
    assert answer["reasons"][0].startswith("bridge.toml: no such file in the workspace.")
    assert "no such file" in page
    assert client.get("/health").json()["status"] == "ok"
    described.write_text(described.read_text().replace("id = 3\n", "id = 7\n", 1))
    answer = client.get("/health")
    page = client.get("/").text
    assert (answer.status_code, answer.json()["status"]) == (200, "degraded")
    assert "hanger 3 is not described" in answer.json()["reasons"][0]
    assert "hanger 3 is not described" in page
    assert "id = 3" in page
    found = [each for each in examine(bridge.folder, utc_now()) if each.check == "hangers"]
    assert any("not described: 3" in each.found and each.remedy for each in found)


def test_a_stranger_is_told_no_details_on_the_pages(client: httpx.Client, described: Path) -> None:
    described.write_text(described.read_text().replace("length_m", "lenght_m", 1))
    page = client.get("/", headers={"X-Forwarded-For": "203.0.113.9"})
    assert page.status_code == 401
    assert "lenght_m" not in page.text


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ("id = 4\ndiameter_m = 0.130", "id = 4\ndiameter = 0.130", 14),
        ("id = 4\ndiameter_m = 0.130", "id = 4\nthresholds = { tension = 1 }\ndiameter_m = 1", 14),
        ("id = 4\n", "id = 4\nscatter.width = 1\n", 14),
        ("nominal_tension_n = 711e3\n\n[settings]", "nominal_tension_n = -1\n\n[settings]", 26),
    ],
)
def test_the_line_of_a_fault_is_that_of_its_own_table(
    bridge: Workspace, described: Path, old: str, new: str, line: int
) -> None:
    changed = described.read_text().replace(old, new, 1)
    assert changed != described.read_text()
    described.write_text(changed)
    with pytest.raises(BadInput) as refused:
        Workspace.described(bridge.folder)
    assert refused.value.line == line, changed.splitlines()[line - 1]
