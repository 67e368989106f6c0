"""The system's Chromium, and what it and axe-core complain of on a page."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import BrowserContext, ConsoleMessage, Page, sync_playwright

DESK, PHONE = {"width": 1100, "height": 900}, {"width": 390, "height": 840}
_NAMES = ("chromium", "chromium-browser", "google-chrome")
_FLAGS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
_LONGEST_MS = 60_000
_DRAW_ALL = """async (longest_ms) => {
  const undrawn = (chart) => !chart.querySelector(".plot svg.main-svg")
    || chart.querySelector(".told").textContent
    || /being worked out/i.test(chart.querySelector(".caption").textContent);
  const end = Date.now() + longest_ms;
  const charts = [...document.querySelectorAll("figure.chart")];
  for (const chart of charts) {
    const part = chart.closest("[data-tab]");
    if (part?.hidden) document.getElementById(`tab-${part.id}`).click();
    chart.closest("details")?.setAttribute("open", "");
    chart.scrollIntoView();
    while (undrawn(chart) && Date.now() < end) await new Promise((done) => setTimeout(done, 30));
  }
  scrollTo(0, 0);
  return charts.filter(undrawn).map((chart) => chart.innerText || chart.dataset.figure);
}"""
# Figures of a part that was hidden take their new width a moment after it is shown.
_WIDTH = """async () => {
  const whole = document.documentElement;
  const end = Date.now() + 5000;
  while (whole.scrollWidth > whole.clientWidth && Date.now() < end) {
    await new Promise((done) => setTimeout(done, 50));
  }
  return whole.scrollWidth;
}"""
_RULES = {"resultTypes": ["violations"]}
_COLOURS = {**_RULES, "runOnly": {"type": "rule", "values": ["color-contrast"]}}
_AXE = Axe()


@dataclass(frozen=True)
class Browser:
    """A window onto a site; `complaints` is what it had to say of what it was given."""

    context: BrowserContext
    complaints: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.context.set_default_timeout(_LONGEST_MS)
        self.context.on("console", lambda message: self._note(message))
        self.context.on("weberror", lambda error: self.complaints.append(str(error.error)))
        self.context.on("requestfailed", lambda request: self.complaints.append(request.url))

    def _note(self, message: ConsoleMessage) -> None:
        if message.type in ("error", "warning"):
            self.complaints.append(message.text)

    def open(self, address: str) -> Page:
        """The page at `address` with all its charts drawn, as on a desk in daylight."""
        page = self.context.new_page()
        page.set_viewport_size(DESK)  # type: ignore[arg-type]
        page.emulate_media(color_scheme="light")
        answer = page.goto(address, wait_until="networkidle")
        assert answer
        assert answer.status == 200
        assert undrawn_charts(page) == []
        return page


@contextmanager
def a_browser() -> Iterator[Browser]:
    """Skips the test where the machine has no Chromium."""
    path = next(filter(None, map(shutil.which, _NAMES)), None)
    if path is None:
        pytest.skip(f"NO BROWSER: none of {', '.join(_NAMES)} is installed (CONTRIBUTING.md)")
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=path, args=list(_FLAGS))
        try:
            yield Browser(chromium.new_context())
        finally:
            chromium.close()


def undrawn_charts(page: Page) -> list[str]:
    """Brings each chart into view; what the charts say that do not come."""
    found: list[str] = page.evaluate(_DRAW_ALL, _LONGEST_MS)
    return found


def faults(page: Page, *, colours_only: bool = False) -> list[str]:
    """Return what axe-core calls serious or critical in any tab, but for what plotly draws."""
    tabs = page.get_by_role("tab").all()
    found = [] if tabs else _faults_shown(page, colours_only)
    for tab in tabs:
        tab.click()
        found += _faults_shown(page, colours_only)
    return found


def _faults_shown(page: Page, colours_only: bool) -> list[str]:
    found = _AXE.run(page, {"exclude": [[".plot svg"]]}, _COLOURS if colours_only else _RULES)
    violations: list[dict[str, Any]] = found.response["violations"]
    return [
        f"{each['id']}: {node['target']} {node['failureSummary']}"
        for each in violations
        if each["impact"] in ("serious", "critical")
        for node in each["nodes"]
    ]


def width_px(page: Page) -> int:
    """How wide the page is in its widest tab; more than its window where it scrolls sideways."""
    widest = 0
    for show in [tab.click for tab in page.get_by_role("tab").all()] or [lambda: None]:
        show()
        widest = max(widest, page.evaluate(_WIDTH))
    return widest
