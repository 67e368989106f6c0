"""The page of the bridge: the elevation, its marks, and the same in a table and in JSON."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from datetime import timedelta
from itertools import pairwise
from pathlib import Path

import httpx
import pytest

from shm.report.formatting import Interval
from shm.report.hanger_status import Status
from shm.store import Workspace
from shm.values import TENSION, Drift, Hanger
from shm_daemon.web import bridge_view
from shm_daemon.web.address import Address
from shm_daemon.web.bridge_view import HangerGlance, elevation
from shm_daemon.web.site import Description, Site
from tests.helpers.nouns import a_summary, averaged
from tests.helpers.taken_in import ingest_quickly
from tests.helpers.web_servers import HTML, served
from tests.helpers.workspaces import START, make_workspace, write_test


def glance(hanger: Hanger, shift: float = 0.0, sd: float = 0.003) -> HangerGlance:
    """Return a hanger whose tension moved by so much since its baseline."""
    moved = Drift(hanger.id, "t9", START, TENSION, 711e3, 711e3, shift, sd, 0.05, 0.1)
    tension = Interval.normal(711e3, 5e3)
    known = {"drifts": (moved,), "baseline": averaged(tension), "tests": 9}
    return HangerGlance(a_summary(hanger, Status.STEADY, tension, **known))


@pytest.fixture(scope="module")
def bridge(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """Hanger 3 has lost a fifth of its tension; hanger 4 was never tested."""
    workspace = make_workspace(tmp_path_factory.mktemp("page") / "bridge", hangers=(3, 4))
    for day, tension in ((0, 1.0), (10, 1.0), (20, 1.0), (40, 0.8), (50, 0.8), (60, 0.8)):
        path = workspace.spool / f"d{day}.modes.json"
        write_test(path, workspace, day=day, tension=tension)
    ingest_quickly(workspace)
    return workspace


@pytest.fixture(scope="module")
def hanger(bridge: Workspace) -> Hanger:
    return bridge.bridge.hangers[0]


def drawn(page: str) -> ET.Element:
    found = re.search(r'<svg class="elevation".*?</svg>', page, re.DOTALL)
    assert found is not None
    return ET.fromstring(found[0])


def test_elevation_marks_each_hanger_with_its_state(client: httpx.Client) -> None:
    """A link with the state in words, in colour, and a loss by an arrow."""
    links = drawn(client.get("/").text).findall("a")
    assert [link.get("href") for link in links] == ["/hangers/3", "/hangers/4"]
    lost, never = (link.get("aria-label", "") for link in links)
    assert re.match(r"Hanger 3, Alert, -(19|20|21)\.?\d* ± .* % since the baseline", lost)
    assert "open alert" in lost
    assert "no test yet" in never
    page = client.get("/").text
    lost, never = drawn(page).findall("a")
    assert "alert" in str(lost.get("class"))
    assert [text.text for text in lost.findall("text[@class='arrow']")] == ["▼"]
    assert lost.find("g[@class='alarm']") is not None
    assert "untested" in str(never.get("class"))
    assert never.findall("text[@class='arrow']") == []
    words = re.findall(r"</svg>([A-Za-z ]+)</li>", page)
    assert words[:2] == ["Alert", "no result yet"]


def test_table_and_json_say_the_same(client: httpx.Client) -> None:
    page = client.get("/").text
    rows = re.findall(r"<tr><th scope=\"row\">.*?</tr>", page, re.DOTALL)
    text = [" ".join(re.sub(r"<[^>]+>", " ", row).split()) for row in rows]
    assert len(text) == 2
    assert re.match(r"Hanger 3 Alert today 5\d\d ± \d+ ", text[0])
    assert re.search(r"-(19|20|21)\.\d+ ± \d+\.\d+", text[0])
    assert text[1].startswith("Hanger 4 next test no test yet")
    assert "/alerts?hanger=3" in rows[0]
    found = client.get("/api/bridge").json()
    lost, never = found["hangers"]
    assert found["status"] == lost["status"] == "alert"
    assert lost["shift"]["low"] < lost["shift"]["mean"] < lost["shift"]["high"] < 0
    assert lost["tension_n"]["mean"] == pytest.approx(0.8 * 711e3, rel=0.03)
    assert (never["status"], never["shift"], never["tension_n"]) == (None, None, None)
    moved = client.get("/api/bridge/moved").json()
    assert "nothing can be compared" in moved["sentence"]
    assert moved["explanations"] == {}


def test_a_bridge_without_hangers_has_a_page(workspace: Workspace) -> None:
    Path(workspace.bridge.source).write_text('[bridge]\nname = "Empty"\n', encoding="utf-8")
    empty = Workspace.open(workspace.folder)
    with served(empty) as site, site.client(**HTML) as client:
        page = client.get("/")
    assert page.status_code == 200
    assert "describes no hanger yet" in page.text


def test_two_hundred_hangers_have_room_and_alarms_keep_their_numbers(hanger: Hanger) -> None:
    many = [glance(replace(hanger, id=number)) for number in range(1, 201)]
    many[96] = replace(many[96], summary=replace(many[96].summary, open_alerts=1))
    drawing = elevation(many)
    places = [mark.x for mark in drawing.hangers]
    steps = [after - before for before, after in pairwise(places)]
    assert min(steps) >= 8.9
    assert places[-1] < drawing.width
    numbered = [mark for mark in drawing.hangers if mark.number]
    assert 97 in [mark.id for mark in numbered]
    gaps = [after.x - before.x for before, after in pairwise(numbered)]
    assert min(gaps) >= 30
    assert len(numbered) > 30


def test_a_hanger_long_not_tested_is_said(bridge: Workspace) -> None:
    site = Site(Description(bridge), Address())
    later = START + timedelta(days=bridge.settings.quiet_days + 1000)
    try:
        for now, quiet in ((START, [False, False]), (later, [True, False])):
            hangers = bridge_view.summarize_hangers(site, now).hangers
            assert [each.is_quiet for each in hangers] == quiet
    finally:
        site.close()
