"""A month of an owner who has a browser and no shell, beside a daemon at work.

A limit, three loggers' files, one held, an alert, a silence, a comparison, a repair, the report.
"""

from __future__ import annotations

from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from playwright.sync_api import Locator, Page, expect

from shm.pipeline import utc_now
from shm.simulate import HammerPlan, HangerState, hammer_test
from shm.store import Workspace
from shm.store.rows import Role
from tests.helpers.browsers import PHONE, a_browser, faults, undrawn_charts
from tests.helpers.daemons import real_daemon
from tests.helpers.flows import ingest
from tests.helpers.web_servers import PASSWORD, in_a_thread, served
from tests.helpers.workspaces import make_workspace, write_held, write_slow_loss
from tests.worlds import logger_files
from tests.worlds.recordings import Channel, Recording

pytestmark = pytest.mark.slow

LOGGERS = {"catman": "Brücke 7.asc", "dewesoft": "visit two.txt", "xlsx": "third.xlsx"}
PLACE_M = 2.52
UNITS = {"force": "N", "acceleration": "m/s²"}


@pytest.fixture(scope="module")
def month(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Page, Workspace, str]]:
    """Yield the page of a signed-in engineer, at a bridge with an alert and a test held."""
    folder = tmp_path_factory.mktemp("month") / "bridge"
    workspace = make_workspace(
        folder, hangers=(3, 4), settings={"cross_check": "none", "workers": 1}
    )
    write_slow_loss(workspace.spool, workspace)
    write_held(workspace, 3)
    ingest(workspace)
    with workspace.store() as store:
        store.people.add("Anna", Role.ENGINEER, PASSWORD, utc_now())
    with in_a_thread(), a_browser() as browser:
        with real_daemon(folder), served(workspace) as running:
            page = browser.open(f"{running.url}/sign-in")
            page.get_by_label("Name").fill("Anna")
            page.get_by_label("Password").fill(PASSWORD)
            page.get_by_role("button", name="Sign in", exact=True).click()
            expect(page.get_by_role("banner")).to_contain_text("Anna")
            yield page, workspace, running.url
        # A page that becomes a download is a page that failed, to Chromium.
        assert [each for each in browser.complaints if not each.endswith("/report.pdf")] == []


def test_a_month_needs_no_shell(month: tuple[Page, Workspace, str], tmp_path: Path) -> None:
    page, workspace, url = month

    def at(address: str) -> Page:
        page.goto(url + address, wait_until="networkidle")
        return page

    limit = at("/settings?hanger=3").locator("article", has_text="tension_max_n")
    limit.get_by_role("textbox").fill("900000")
    limit.get_by_role("button", name="Set", exact=True).click()
    expect(page.locator("article", has_text="tension_max_n")).to_contain_text("900000")
    whole(page)

    for number, (logger, name) in enumerate(LOGGERS.items()):
        written(logger, tmp_path / name, workspace, number)
        at("/upload").get_by_label("Recordings of hammer tests").set_input_files(tmp_path / name)
        card = page.locator("#list li")
        answered(card.locator("form.questions"))
        expect(card).to_contain_text("Done.", timeout=120_000)
        expect(card.get_by_role("link").first).to_have_text("Hanger 3")
        whole(page)

    held = at("/operation").locator("article", has_text="epoch3")
    held.get_by_text("Decide", exact=True).click()
    whole(page)
    held.get_by_label("True time of the test").fill("2026-03-01T10:00")
    held.get_by_label("Why").fill("Its clock was dead.")
    held.get_by_role("button", name="Confirm").click()
    expect(page.get_by_text("was confirmed by Anna: Its clock was dead.")).to_be_visible()

    alert = at("/alerts").locator("article.card.open", has_text="tension").first
    alert.get_by_text("Acknowledge", exact=True).click()
    alert.get_by_label("Result").fill("A clamp had slipped.")
    alert.get_by_role("button").click()
    expect(page.get_by_text("Acknowledged by Anna: A clamp had slipped.").first).to_be_visible()

    silences = page.locator("section[aria-labelledby=silences]")
    silences.get_by_text("Silence notifications").click()
    silences.get_by_label("Of", exact=True).select_option("3")
    silences.get_by_label("Until, UTC").fill(f"{utc_now() + timedelta(days=2):%Y-%m-%dT%H:%M}")
    silences.get_by_label("Why").fill("The clamp is replaced.")
    silences.get_by_role("button", name="Start silence").click()
    expect(silences.get_by_text("hooks receive nothing about hanger 3")).to_be_visible()
    whole(page)
    silences.get_by_role("button", name="End silence").click()
    expect(silences.get_by_text("Notifications are on for all hangers.")).to_be_visible()

    at("/compare").get_by_role("checkbox", name="Hanger 3").check()
    page.get_by_role("button", name="Compare").click()
    expect(page.get_by_role("heading", name="Tension since the baseline")).to_be_visible()
    whole(page)

    at("/hangers/3").get_by_text("Write a note").click()
    page.get_by_label("Kind").select_option("repair")
    page.get_by_label("What was seen or done").fill("New clamp at the lower end.")
    page.get_by_role("button", name="Keep", exact=True).click()
    expect(page.get_by_text("New clamp at the lower end.")).to_be_visible()
    whole(page)

    with page.expect_download() as downloaded:
        page.get_by_role("link", name="PDF").click()
    assert downloaded.value.path().read_bytes().startswith(b"%PDF")


def whole(page: Page) -> None:
    """By day and night, on desk and phone, nothing serious and nothing off to the side."""
    assert undrawn_charts(page) == []
    for scheme in ("dark", "light"):
        page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
        assert faults(page) == []
    desk = page.viewport_size
    page.set_viewport_size(PHONE)  # type: ignore[arg-type]
    page.wait_for_function(  # charts follow the window a little later
        "width => document.documentElement.scrollWidth === width", arg=PHONE["width"]
    )
    page.set_viewport_size(desk)  # type: ignore[arg-type]


def answered(form: Locator) -> None:
    """Answer what the file leaves open; the third sensor's plane is that of the first."""
    expect(form).to_be_visible()
    planes = 0
    for line in form.locator("div").all():
        if not line.locator("input[type=text]").count():
            continue
        question = line.inner_text()
        if "unit" in question:
            said = "N" if "orce" in question or "ammer" in question else "m/s2"
        elif "anger" in question and "hich" in question:
            said = "3"
        elif "plane" in question or "direction" in question:
            said, planes = ("transverse", "longitudinal")[planes % 2], planes + 1
        else:
            said = str(PLACE_M)
        line.locator("input").fill(said)
    stays = form.locator(".carried input[type=checkbox]")
    if stays.count():
        stays.uncheck()  # all its files are of this hanger
    form.get_by_role("button", name="Keep for this logger, and send").click()


def written(logger: str, path: Path, workspace: Workspace, number: int) -> None:
    """Return a hammer test of hanger 3 as a logger exports it."""
    plan = HammerPlan(hits=3, seconds_per_hit=6.0, sensors_x_m=(PLACE_M,))
    struck = hammer_test(
        workspace.bridge.hanger(3),
        HangerState(tension_n=0.92 * 711e3, damping_ratio=0.002),
        plan,
        np.random.default_rng(number),
    )
    channels = tuple(
        Channel(c.name, cast("Any", c.quantity), UNITS[c.quantity], c.plane, c.x_m, 1e4, 24)
        for c in struck.channels
    )
    data = np.column_stack([c.values for c in struck.channels])
    made = utc_now() - timedelta(days=3 - number)
    recording = Recording(
        "plain", number, data, channels, struck.sampling_rate_hz, made, 12.0,
        workspace.bridge.hanger(3).length_m, truth=cast("Any", None),
    )  # fmt: skip
    logger_files.write(logger, path, recording)
