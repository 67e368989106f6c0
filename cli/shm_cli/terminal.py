"""Escape control characters in all text that a verb prints to a terminal.

Names, notes, reasons and files are written by others, and must not move the cursor or hide other
text. Whatever a verb prints goes through `escape_controls`: in `cleaned_output` by `click.echo` or
`print`, by `Terminal` with rich.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any, TextIO

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.text import Text

_CONTROLS = re.compile(
    # C0 but tabulator and newline, DEL and C1; a return only at the end of a line.
    "[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f]|\r(?!\n)"
    # Marks, embeddings, overrides and isolates of direction; what else is drawn as nothing.
    "|[\u00ad\u061c\u180e\u200b\u200e\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb]"
    "|[\ud800-\udfff\U000e0000-\U000e007f]"
)


def escape_controls(text: str) -> str:
    r"""Return a text with each control character as JSON escapes it, such as ``\u001b``.

    Newlines and tabulators stay; JSON keeps its meaning.
    """
    return _CONTROLS.sub(lambda found: json.dumps(found[0])[1:-1].replace("\x7f", "\\u007f"), text)


class Terminal(Console):
    """A console of rich that escapes the controls of what it prints, but for its own styles."""

    def render_str(self, text: str, **options: Any) -> Text:
        """Return a text to lay out, of the width that it will have."""
        return super().render_str(escape_controls(text), **options)

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Yield what is printed, texts of other makers included."""
        for text, style, control in super().render(renderable, options):
            yield Segment(text if control else escape_controls(text), style, control)


class _Cleaned:
    """A stream whose text has its controls escaped; rich's consoles write past it."""

    def __init__(self, stream: TextIO):
        self.rich_proxied_file = stream

    def write(self, text: str) -> int:
        self.rich_proxied_file.write(escape_controls(text))
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.rich_proxied_file, name)


@contextmanager
def cleaned_output() -> Iterator[None]:
    """Escape the controls of all that is written to stdout and stderr while the context lasts."""
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = (_Cleaned(stream) for stream in before)
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before
