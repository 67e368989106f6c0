"""The manual: its commands are those of the command line, its pages and anchors are found."""

from __future__ import annotations

import re
from pathlib import Path

import click
import pytest

from tests.helpers.command_lines import commands, fenced_commands, inline_commands, parse, words_of
from tests.helpers.pages import BUILT, DOCS, PAGES, ROOT, links, name_of

TYPED = [
    pytest.param(line, id=f"{name_of(page)}: {line}")
    for page in (*PAGES, ROOT / "README.md")
    for line in fenced_commands(page)
]
NAMES = dict(commands())


@pytest.fixture(autouse=True)
def files_need_not_exist(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        click.Path, "convert", lambda self, value, *_: self.coerce_path_result(value)
    )


@pytest.mark.parametrize("line", TYPED)
def test_a_command_of_a_page_is_taken(line: str) -> None:
    assert parse(line).startswith("shm ")


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_what_a_sentence_calls_a_command_is_one(page: Path) -> None:
    for line in inline_commands(page):
        words = words_of(line.replace("--workspace arch", ""))
        named = [word for word in words if not word.startswith(("-", "/"))]
        spoken_of = {" ".join(named[:length]) for length in (1, 2, 3)} & set(NAMES)
        assert spoken_of or {"--help", "--debug", "--version"} & set(words) or "..." in line, line
        known = {
            option
            for name in spoken_of
            for parameter in NAMES[name].params
            for option in parameter.opts
        } | {"--workspace", "--help", "--debug"}
        given = {word for word in words if word.startswith("--") and word.isascii()}
        assert not given - known, line
        called = NAMES.get(max(spoken_of, key=len, default=""))
        if (
            called is not None
            and given - {"--workspace", "--help", "--debug"}
            and "..." not in line
        ):
            # A command with options is there to be typed: it has all that it needs.
            required = [p for p in called.params if isinstance(p, click.Option) and p.required]
            assert [p.opts[0] for p in required if not given & {*p.opts}] == [], line


def test_every_page_has_its_place_in_the_tree() -> None:
    listed = re.findall(
        r"^```\{toctree\}\n(.*?)^```$", (DOCS / "index.md").read_text(), re.M | re.S
    )
    entries = [line for block in listed for line in block.splitlines() if line[:1] not in (":", "")]
    assert sorted(entries) == sorted({*map(name_of, {*PAGES, *BUILT})} - {"index"})


def test_the_index_says_of_every_page_what_it_is_for() -> None:
    linked = {DOCS / file for file, _ in links((DOCS / "index.md").read_text())}
    assert linked == {*PAGES} - {DOCS / "index.md"}


@pytest.mark.parametrize("page", [*PAGES, ROOT / "README.md"], ids=name_of)
def test_anchors_lead_to_headings(page: Path) -> None:
    for file, anchor in links(page.read_text()):
        target = page.parent / file if file else page
        assert not anchor or anchor in _anchors(target), f"{file}#{anchor}"


def _anchors(page: Path) -> set[str]:
    """Return the anchors of a page's headings, as readers of Markdown form them."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.M | re.S)
    headings = re.findall(r"^#+ (.+)$", text, re.M)
    return {
        re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings
    }
