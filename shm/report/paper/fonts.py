"""The fonts on paper: DejaVu Sans as matplotlib ships it, which holds every sign that we use."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import matplotlib
from reportlab.lib.fonts import addMapping
from reportlab.pdfbase import pdfmetrics
from reportlab.pdfbase.ttfonts import TTFont

PLAIN = "DejaVuSans"
BOLD = "DejaVuSans-Bold"


@cache
def register() -> None:
    """Makes the fonts known to reportlab, which embeds the signs that a document uses."""
    folder = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
    for name in (PLAIN, BOLD):
        pdfmetrics.registerFont(TTFont(name, folder / f"{name}.ttf"))
    for is_bold in (0, 1):
        for is_italic in (0, 1):
            addMapping(PLAIN, is_bold, is_italic, BOLD if is_bold else PLAIN)


def width(text: str, font: str, size: float) -> float:
    """How wide `text` is set, in points."""
    register()
    return float(pdfmetrics.stringWidth(text, font, size))
