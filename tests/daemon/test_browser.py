"""A person's walk over the dashboard in a real browser, beside a daemon at work.

What takes long is worked out in a thread here: the processes for it are tested by themselves.

The bridge has one hanger of four tests: three came as modes and show a loss, which raised an
alert; the fourth is a recording, so that its page has every figure.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from shm.pipeline import utc_now
from shm.read import write
from shm.simulate import HammerPlan, HangerState, hammer_test
from shm.store import Stage, Workspace
from shm.store.journal import Actor
from shm.store.recordings import list_recordings
from shm.store.rows import Role
from shm_daemon.web.address import test_page as page_of
from shm_daemon.web.frame import FOR_ENGINEERS, NAVIGATION
from tests.helpers.browsers import PHONE, Browser, a_browser, faults, undrawn_charts, width_px
from tests.helpers.daemons import real_daemon
from tests.helpers.flows import ingest
from tests.helpers.slow import few_of
from tests.helpers.taken_in import ingest_quickly
from tests.helpers.web_servers import PASSWORD, Served, in_a_thread, served
from tests.helpers.workspaces import START, make_workspace, write_held, write_loss, write_test

RECORDED = "recorded"
PAGES = {
    "hanger": "/hangers/3",
    "tests": "/hangers/3/tests",
    "modes": page_of(3, "t1"),
    "recording": page_of(3, RECORDED),
    **{name.lower(): address for address, name in (*NAVIGATION, *FOR_ENGINEERS)},
    "limits": "/settings?hanger=3",
    "baseline": "/hangers/3/baseline",
    "bridges": "/bridges",
    "password": "/password",
}
CHARTS = {"hanger": 3, "recording": 5}
PAPER, INK = "rgb(255, 255, 255)", "rgb(29, 35, 48)"
PAPER_WIDE = "640px"
HIGHEST_PX = 2500
COMMANDS = re.compile(r"`|\bshm (drift|gap|alerts|doctor|ingest|import|stream|status)\b")


@dataclass(frozen=True)
class Site:
    """The interface at work."""

    served: Served
    workspace: Workspace

    @property
    def url(self) -> str:
        return self.served.url


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with a_browser() as browser:
        yield browser


@pytest.fixture(scope="module")
def site(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    folder = tmp_path_factory.mktemp("browser") / "bridge"
    workspace = make_workspace(folder, settings={"cross_check": "none", "workers": 1})
    write_loss(workspace.spool, workspace)
    write_recording(workspace)
    ingest(workspace)
    with workspace.store() as store:
        store.people.add("Anna", Role.ENGINEER, PASSWORD, utc_now())
        assert {each.stage for each in list_recordings(store)} == {Stage.DONE}
        assert [each.test.id for each in store.tests.list_all(3)][-1] == RECORDED
    with in_a_thread(), real_daemon(folder), served(workspace) as running:
        yield Site(running, workspace)


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """Return a bridge of 17 hangers, of which the tenth has lost tension."""
    folder = tmp_path_factory.mktemp("many") / "bridge"
    workspace = make_workspace(folder, hangers=range(1, 18))
    for day, tension in ((0, 1.0), (10, 1.0), (20, 1.0), (40, 0.8), (50, 0.8)):
        path = workspace.spool / f"d{day}.modes.json"
        write_test(path, workspace, hanger=10, day=day, tension=tension)
    ingest_quickly(workspace)
    with served(workspace) as running:
        yield running


@pytest.fixture(autouse=True)
def content(browser: Browser) -> Iterator[None]:
    """After each test the browser has nothing to complain of."""
    yield
    complaints = list(browser.complaints)
    browser.complaints.clear()
    for page in browser.context.pages:
        page.close()
    assert complaints == []


@pytest.fixture(scope="module")
def signed_in(browser: Browser, site: Site) -> Browser:
    page = browser.open(f"{site.url}/sign-in?next=/upload")
    assert faults(page) == []
    page.get_by_label("Token").fill(site.served.write_token)
    page.get_by_role("button", name="Sign in with the token").click()
    expect(page.get_by_role("heading", level=1)).to_have_text("Upload recordings")
    expect(page.get_by_role("banner")).to_contain_text("write")
    page.get_by_role("button", name="Sign out").click()
    page.get_by_label("Name").fill("Anna")
    page.get_by_label("Password").fill(PASSWORD)
    page.get_by_role("button", name="Sign in", exact=True).click()
    expect(page.get_by_role("banner")).to_contain_text("Anna")
    return browser


@pytest.mark.parametrize("name", few_of(PAGES, 2))
def test_page_is_whole_for_everybody(signed_in: Browser, site: Site, name: str) -> None:
    page = signed_in.open(site.url + PAGES[name])
    assert page.locator("figure.chart").count() >= CHARTS.get(name, 0)
    assert faults(page) == []
    page.emulate_media(color_scheme="dark")
    assert faults(page, colours_only=True) == []
    page.set_viewport_size(PHONE)  # type: ignore[arg-type]
    assert undrawn_charts(page) == []
    assert faults(page) == []
    assert width_px(page) == PHONE["width"]
    if name in CHARTS:
        assert printed(page, ".xtitle", "fill") == INK
        assert printed(page, ".plot .main-svg", "width") == PAPER_WIDE
        expect(page.locator(".xtitle").first).not_to_have_css("fill", INK)
    page.emulate_media(media="print", color_scheme="dark")
    assert style(page, "body", "backgroundColor") == PAPER


@pytest.mark.parametrize("name", few_of(PAGES, 3))
def test_page_parts_are_short(signed_in: Browser, site: Site, name: str) -> None:
    page = signed_in.open(site.url + PAGES[name])
    page.set_viewport_size({"width": 1280, "height": 900})
    for show in [tab.click for tab in page.get_by_role("tab").all()] or [lambda: None]:
        show()
        assert page.evaluate("document.documentElement.scrollHeight") <= HIGHEST_PX
        assert COMMANDS.findall(page.inner_text("main")) == []


def test_hangers_are_kept_as_numbers(signed_in: Browser, site: Site) -> None:
    page = signed_in.open(site.url)
    with page.expect_download() as download:
        page.get_by_role("button", name="Keep as CSV").first.click()
    text = download.value.path().read_text(encoding="utf-8-sig")
    (row,) = csv.DictReader(text.splitlines())
    assert (row["hanger"], row["state"], row["when_to_act"]) == ("3", "Alert", "today")
    low, mean, high = (float(row[f"tension{of}_kn"]) for of in ("_q05", "", "_q95"))
    assert 500 < low < mean < high < 640
    assert float(row["shift_q05_percent"]) < float(row["shift_percent"]) < 0
    assert datetime.fromisoformat(row["last_test_at"]).tzinfo is not None


def test_another_table_is_kept_as_shown(signed_in: Browser, site: Site) -> None:
    page = signed_in.open(f"{site.url}/hangers/3/tests")
    table = page.locator("main table").first
    with page.expect_download() as download:
        table.get_by_role("button", name="Keep as CSV").click()
    heading, *rows = csv.reader(download.value.path().read_text("utf-8-sig").splitlines())
    assert [name for name in heading if name] == table.locator("thead th").all_inner_texts()
    assert any("t1" in row[0] for row in rows)


def test_hangers_are_sorted_and_chosen(signed_in: Browser, many: Served) -> None:
    """By number, by severity, and a number finds the hanger of that number first."""
    page = signed_in.open(many.url)
    names, states = (
        page.locator(f"table.hangers tbody tr:visible {of}") for of in ("th", ".status")
    )
    page.get_by_role("button", name="hanger", exact=True).click()
    assert names.all_inner_texts() == [f"Hanger {number}" for number in range(1, 18)]
    page.get_by_role("button", name="state", exact=True).click()
    assert names.first.inner_text() == "Hanger 10"
    assert states.all_inner_texts()[:1] == ["Alert"]
    field = page.get_by_label("Only rows with")
    for words, shown in (("7", ["Hanger 7"]), ("alert", ["Hanger 10"]), ("HANGER 1", ["Hanger 1"])):
        field.fill(words)
        assert names.all_inner_texts() == shown, words
    field.fill("")
    page.set_viewport_size(PHONE)  # type: ignore[arg-type]
    arch = page.locator("svg.elevation").bounding_box()
    assert arch
    assert arch["x"] + arch["width"] <= PHONE["width"]
    for heading in ("hanger", "state", "when to act", "tension"):
        box = page.locator("table.hangers thead th", has_text=heading).first.bounding_box()
        assert box
        assert box["x"] + box["width"] <= PHONE["width"], heading


def test_the_keyboard_and_tabs_reach_every_part(signed_in: Browser, site: Site) -> None:
    page = signed_in.open(site.url)
    page.keyboard.press("Tab")
    skip = page.get_by_role("link", name="Skip to the content")
    expect(skip).to_be_focused()
    expect(skip).to_be_in_viewport()
    page.keyboard.press("Enter")
    expect(page.locator("main")).to_be_focused()
    hanger = page.locator("svg.elevation a.hanger")
    for _ in range(10):
        page.keyboard.press("Tab")
        if hanger.evaluate("each => each === document.activeElement"):
            break
        assert style(page, ":focus", "outlineStyle") == "solid"
    expect(hanger).to_be_focused()
    assert style(page, "a.hanger:focus .hit", "strokeWidth") == "3px"
    expect(hanger).to_have_attribute("href", "/hangers/3")


@pytest.mark.parametrize(("address", "shown"), [("", "now"), ("#trend", "trend")])
def test_tabs_open_one_part(signed_in: Browser, site: Site, address: str, shown: str) -> None:
    page = signed_in.open(site.url)

    page.goto(f"{site.url}/hangers/3{address}")

    visible = page.locator("[data-tab]:visible")

    expect(visible).to_have_count(1)
    expect(visible).to_have_id(shown)


def test_an_uploaded_file_becomes_a_test(signed_in: Browser, site: Site, tmp_path: Path) -> None:
    path = tmp_path / "sent by hand.modes.json"
    write_test(path, site.workspace, day=120, tension=0.8)
    page = signed_in.open(f"{site.url}/upload")
    page.get_by_label("Recordings of hammer tests").set_input_files(path)
    card = page.locator("#list li")
    expect(card).to_contain_text("Done.", timeout=60_000)
    card.get_by_role("link", name="Test sent by hand").click()
    expect(page.get_by_role("heading", level=1)).to_contain_text("sent by hand")


def test_an_alert_is_acknowledged_with_a_name_and_a_reason(signed_in: Browser, site: Site) -> None:
    page = signed_in.open(f"{site.url}/alerts")
    before = page.locator("article.card.open").count()
    card = page.locator("article.card", has_text="tension fell").first
    card.get_by_text("Acknowledge", exact=True).click()
    card.get_by_label("Result").fill("A clamp had slipped; <set> right.")
    card.get_by_role("button").click()
    expect(card).to_contain_text("Acknowledged by Anna")
    expect(card).to_contain_text("A clamp had slipped; <set> right.")
    expect(card).to_be_focused()
    assert faults(page) == []
    page.reload()
    expect(page.get_by_text("A clamp had slipped; <set> right.")).to_be_visible()
    assert page.locator("article.card.open").count() == before - 1
    card = page.locator("article.card", has_text="A clamp had slipped")
    card.get_by_text("Resolve", exact=True).click()
    card.get_by_label("Result").fill("The clamp holds.")
    card.get_by_role("button").click()
    expect(card).to_contain_text("Resolved by Anna: The clamp holds.")
    assert page.locator("article.card.open").count() == before - 1


def test_phone_shows_what_matters(signed_in: Browser, site: Site) -> None:
    page = signed_in.open(site.url)
    page.set_viewport_size(PHONE)  # type: ignore[arg-type]
    tension = page.locator("table.hangers th", has_text="tension").bounding_box()
    assert tension
    assert tension["x"] + tension["width"] <= PHONE["width"]
    name = page.locator(".brand")
    name.evaluate("each => { each.firstChild.textContent = 'Straßenbrücke'.repeat(20); }")
    box = name.bounding_box()
    assert box
    assert box["height"] < 50  # two lines
    assert width_px(page) == PHONE["width"]
    with site.workspace.store() as store:
        anna = store.acting_as(Actor("Anna", "page"))
        anna.journal.note(utc_now(), "recording uploaded", "a_long_name.csv", "and words " * 9)
    page.goto(f"{site.url}/audit")
    assert page.locator(".scroll").evaluate("each => each.scrollWidth <= each.clientWidth")
    page.goto(f"{site.url}/upload")
    numbers = "hammer channel with a long name;lower accelerometer, across\n" + "0.1;0.2\n" * 999
    file = {"name": "new logger.csv", "mimeType": "text/csv", "buffer": numbers.encode()}
    page.get_by_label("Recordings of hammer tests").set_input_files(files=[file])  # type: ignore[list-item]
    expect(page.locator("form.questions")).to_be_visible()
    assert width_px(page) == PHONE["width"]


def test_held_upload_is_decided(signed_in: Browser, site: Site, tmp_path: Path) -> None:
    write_held(site.workspace, 3, tmp_path)
    (path,) = tmp_path.iterdir()
    page = signed_in.open(f"{site.url}/upload")
    page.get_by_label("Recordings of hammer tests").set_input_files(path)
    card = page.locator("#list > li")
    expect(card).to_contain_text("is held", timeout=60_000)
    assert "1970" in card.inner_text()
    assert faults(page) == []
    card.get_by_text("Decide", exact=True).click()
    card.get_by_label("Why").fill("The clock of the logger was not set.")
    card.get_by_role("button", name="Discard").click()
    expect(page.locator("#main")).to_contain_text("discarded by Anna: The clock of the logger")


def write_recording(workspace: Workspace) -> None:
    plan, rng = HammerPlan(hits=3, seconds_per_hit=6.0), np.random.default_rng(5)
    state = HangerState(tension_n=0.8 * 711e3, damping_ratio=0.002)
    struck = hammer_test(
        workspace.bridge.hanger(3), state, plan, rng,
        time=START + timedelta(days=90), temperature_c=12.5,
    )  # fmt: skip
    write(replace(struck, hanger=3), workspace.spool / f"{RECORDED}.uff")


def style(page: Page, selector: str, name: str) -> str:
    element = page.locator(selector).first
    return str(element.evaluate(f"each => getComputedStyle(each).{name}"))


def printed(page: Page, selector: str, name: str) -> str:
    """Return the style of an element while the page is printed."""
    page.evaluate(
        """([selector, name]) => addEventListener("beforeprint", () => {
             window.printed = getComputedStyle(document.querySelector(selector))[name];
           })""",
        [selector, name],
    )
    page.pdf()
    return str(page.evaluate("window.printed"))
