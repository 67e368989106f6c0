"""Show a shell command that a message names as a link to the page that does the same.

Messages are the same on every face; a reader of a page has pages and buttons at hand, no shell.
"""

from __future__ import annotations

import re
from contextvars import ContextVar

from markupsafe import Markup, escape

from shm.report.as_html import with_code

_PAGES = (
    ("drift bridge", "/compare", "Compare"),
    ("drift rebaseline", "/hangers/{hanger}/baseline", "Baseline"),
    ("gap diagnose", "/hangers/{hanger}/diagnosis", "Gap diagnosis"),
    ("ingest --held", "/operation#held", "Held tests"),
    ("ingest --confirm", "/operation#held{number}", "Confirm"),
    ("ingest --discard", "/operation#held{number}", "Discard"),
    ("ingest FILE", "/upload", "Upload"),
    ("import FILE", "/upload", "Upload"),
    ("alerts ack", "/alerts#alert{number}", "Acknowledge"),
    ("alerts test", "/settings#notifications", "Settings"),
    ("alerts", "/alerts", "Alerts"),
    ("doctor", "/operation#examination", "Examination"),
    ("stream", "/streams", "Sensors"),
    ("status", "/", "Bridge"),
)
"""Verb, address and name of the page. Verbs that begin alike: the longer first."""
_VERBS = "|".join(re.escape(verb) for verb, _, _ in _PAGES)
_OPTIONS = r"(?: (?:-{1,2}[a-z]+|[A-Z]+|\d+))*"
_COMMAND = re.compile(
    rf"`shm (?P<quoted>{_VERBS})(?![ -][a-z])(?P<options>[^`]*)`"
    rf"|\bshm (?P<bare>gap diagnose|drift rebaseline|drift bridge)(?P<rest>{_OPTIONS})"
)
_AGAIN = re.compile(r"\b([Dd])rop it again with `hanger = (\d+)` in its sidecar")
_LINK = Markup('<a href="{}">{}</a>')
_FOR_ENGINEERS = frozenset({"Baseline", "Settings"})
_HANGER: ContextVar[int | None] = ContextVar("hanger of the page", default=None)
_IS_ENGINEER: ContextVar[bool] = ContextVar("an engineer reads the page", default=True)


def set_reader(hanger: int | None, *, is_engineer: bool = True) -> None:
    """Set the hanger of the page, which a command without a number means, and who reads it."""
    _HANGER.set(hanger)
    _IS_ENGINEER.set(is_engineer)


def with_links(text: str) -> Markup:
    """Return the text for a page: commands as links to pages, where there is one, else as code."""
    if again := _AGAIN.search(text):
        before, after = text[: again.start()], text[again.end() :]
        verb = "Upload it again" if again[1] == "D" else "upload it again"
        to_upload = _LINK.format("/upload", verb)
        return with_links(before) + to_upload + f" as hanger {again[2]}" + with_links(after)
    parts, end = [], 0
    for found in _COMMAND.finditer(text):
        verb = found["quoted"] or found["bare"]
        link = _link(verb, found["options"] or found["rest"] or "", text)
        if link is not None:
            parts += [with_code(text[end : found.start()]), link]
            end = found.end()
    return Markup().join([*parts, with_code(text[end:])])


def without_commands(text: str) -> str:
    """Return the text with the names of pages for their commands, where a link cannot stand."""
    return with_links(text).striptags()


def _link(verb: str, options: str, text: str) -> Markup | None:
    """Return the link to the page of a command; None where its hanger is not known."""
    address, name = next((address, name) for each, address, name in _PAGES if each == verb)
    if name in _FOR_ENGINEERS and not _IS_ENGINEER.get():
        return escape(f"page {name}, for engineers")
    numbered = re.match(r" (\d+)\b", options)
    address = address.replace("{number}", f"-{numbered[1]}" if numbered else "")
    if "{hanger}" in address:
        given = re.search(r"--hanger (\d+)", options) or re.match(r"Hanger (\d+)\b", text)
        hanger = int(given[1]) if given else _HANGER.get()
        if hanger is None:
            return None
        address = address.replace("{hanger}", str(hanger))
    return _LINK.format(address, escape(name))
