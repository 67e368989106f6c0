"""A parsed page: does it nest, what does it hold; and the words of each form of a report."""

from __future__ import annotations

from html.parser import HTMLParser

from shm.report.as_html import as_html
from shm.report.as_pdf import as_pdf
from shm.report.as_text import as_text
from shm.report.paper import Paper
from tests.helpers.pdf_words import Pdf

VOID = {"meta", "br", "hr", "img", "link", "input"}


class Outline(HTMLParser):
    """Checks that tags nest and keeps their attributes and the visible words."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []

    @classmethod
    def of(cls, page: str) -> Outline:
        parsed = cls()
        parsed.feed(page)
        assert parsed.open == []
        return parsed

    @property
    def names(self) -> list[str]:
        return [tag for tag, _ in self.tags]

    @property
    def told(self) -> str:
        return flat(" ".join(self.words))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if not {"style", "script"} & set(self.open):
            self.words.append(data)


def flat(text: str) -> str:
    """Return the text on one line: where lines fold is the renderer's."""
    return " ".join(text.split())


def text_words(paper: Paper) -> str:
    return flat(as_text(paper))


def page_words(paper: Paper) -> str:
    return Outline.of(as_html(paper)).told


def pdf_words(paper: Paper) -> str:
    return Pdf.parse(as_pdf(paper)).words
