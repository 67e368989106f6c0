"""Notes on the pages of hanger and bridge: who writes, who reads, the photo, the figures."""

from __future__ import annotations

import io
from collections.abc import Iterator
from datetime import timedelta

import httpx
import numpy as np
import pytest
from PIL import Image

from shm.pipeline import utc_now
from shm.pipeline.reporting import hanger_report
from shm.report.as_html import as_html
from shm.report.figures.hanger_trend import FIGURE
from shm.report.figures.specification import Points
from shm.report.hanger_report import hanger_json, hanger_paper
from shm.store import Workspace
from shm.store.journal import list_changes
from shm.values.notes import NoteKind
from shm_daemon.web.address import Address
from tests.daemon.test_web_people import add_a_user_of_each_role, sign_in
from tests.helpers.taken_in import with_a_slow_loss
from tests.helpers.web_servers import served

NOTE = {"hanger": "3", "kind": "repair", "at": "2026-05-01", "text": "new pin\r\n<b>lower</b> end"}


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    made = with_a_slow_loss(tmp_path_factory.mktemp("notes") / "bridge")
    add_a_user_of_each_role(made)
    return made


@pytest.fixture
def browser(workspace: Workspace) -> Iterator[httpx.Client]:
    with served(workspace, Address("0.0.0.0")) as site, site.client(Origin=site.url) as client:
        yield client


def test_an_operator_writes_and_a_reader_sees_the_note_its_photo_and_its_mark(
    browser: httpx.Client, workspace: Workspace
) -> None:
    noise = np.random.default_rng(1).integers(0, 256, (200, 150, 3), np.uint8)
    image = io.BytesIO()
    Image.fromarray(noise).save(image, "PNG")  # with line ends of every kind among its bytes
    file = {"photo": ("pin.png", image.getvalue(), "image/png")}
    sign_in(browser, "reader")
    assert "Write a note" not in browser.get("/hangers/3").text
    assert browser.post("/notes", data=NOTE, files=file).status_code == 403
    sign_in(browser, "operator")
    assert "Write a note" in browser.get("/hangers/3").text
    foreign = {"Origin": "https://elsewhere.example"}
    assert browser.post("/notes", data=NOTE, files=file, headers=foreign).status_code == 403
    assert browser.post("/notes", data=NOTE).status_code == 415
    written = browser.post("/notes", data=NOTE, files=file)
    assert (written.status_code, written.headers["location"]) == (303, "/hangers/3#notes")
    empty = {"photo": ("", b"", "application/octet-stream")}  # as a browser sends none
    of_bridge = {"hanger": "", "kind": "inspection", "at": "", "text": "storm"}
    assert browser.post("/notes", data=of_bridge, files=empty).headers["location"] == "/#notes"
    for wrong in ({"kind": "x"}, {"at": "x"}, {"hanger": "x"}, {"hanger": "99"}, {"text": " "}):
        refused = browser.post("/notes", data={**NOTE, **wrong}, files=file)
        assert (wrong, refused.status_code // 100) == (wrong, 4)

    sign_in(browser, "reader")
    shown = browser.get("/hangers/3").text
    assert "Notes and inspections (2)" in shown
    assert "Repair of hanger 3, <time>2026-05-01" in shown
    assert "new pin\n&lt;b&gt;lower&lt;/b&gt; end" in shown
    assert "storm" in browser.get("/").text
    assert "new pin" not in browser.get("/").text
    assert "storm" in browser.get("/hangers/4").text  # which has no test
    photo = browser.get("/notes/1/photo")
    assert photo.headers["content-type"] == "image/jpeg"
    assert Image.open(io.BytesIO(photo.content)).size == (150, 200)
    assert browser.get("/notes/2/photo").status_code == 404
    with workspace.store() as store:
        assert [row.who for row in list_changes(store, 2)] == ["operator", "operator"]
    traces = browser.get("/api/hangers/3/figures/trend").json()["data"]
    (marked,) = [each for each in traces if each.get("name") == "repair"]
    assert "of hanger 3 by operator: new pin" in str(marked)


def test_the_report_marks_and_lists_the_notes_of_its_period(workspace: Workspace) -> None:
    now = utc_now()
    with workspace.store() as store:
        store.notes.add(3, now - timedelta(hours=1), NoteKind.INSPECTION, "rust", "a", now)
        report = hanger_report(workspace, store, 3, now)
    drawn = FIGURE.draw(report)
    (mark,) = [
        each
        for each in drawn.panels[0].marks
        if isinstance(each, Points) and "rust" in str(each.texts)
    ]
    assert mark.name == "inspection"
    assert now - timedelta(hours=1) < drawn.panels[0].x.range[1]
    assert "rust" in str(hanger_json(report)["inspections"])
    assert "rust" in as_html(hanger_paper(report))
