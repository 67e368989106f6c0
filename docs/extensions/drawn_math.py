"""Equations of the manual as drawings inside the page: no LaTeX, no script, no network.

matplotlib lays them out; the strokes take the colour of the text, the source is read aloud.
"""

from __future__ import annotations

from html import escape
from typing import Any

from docutils import nodes
from matplotlib.font_manager import FontProperties
from matplotlib.path import Path
from matplotlib.textpath import TextToPath
from sphinx.application import Sphinx
from sphinx.errors import SphinxError

_SIZE = 10.0
_FONT = FontProperties(size=_SIZE, math_fontfamily="stix")
_INLINE, _BLOCK = 1.1, 1.25
"""Size of the letters beside those of the text, which are larger for their number."""
_LETTERS = {Path.MOVETO: "M", Path.LINETO: "L", Path.CURVE3: "Q", Path.CURVE4: "C"}


def drawing(source: str, scale: float) -> str:
    """One line of LaTeX mathematics as an SVG element; raises SphinxError naming the line."""
    text = f"${' '.join(source.split())}$"
    layout = TextToPath()
    try:
        width, height, descent = layout.get_text_width_height_descent(text, _FONT, ismath=True)
        strokes = Path(*layout.get_text_path(_FONT, text, ismath=True))
    except ValueError as error:
        raise SphinxError(f"matplotlib cannot lay out {text}: {error}") from error
    em, shrunk = scale / _SIZE, _SIZE / layout.FONT_SCALE
    return (
        f'<svg class="drawn-math" role="img" aria-label="{escape(source.strip())}"'
        f' style="width:{width * em:.3f}em;height:{height * em:.3f}em;'
        f'vertical-align:{-descent * em:.3f}em" fill="currentColor" overflow="visible"'
        f' viewBox="0 {descent - height:.3f} {width:.3f} {height:.3f}">'
        f'<path transform="scale({shrunk},{-shrunk})" d="{_commands(strokes)}"/></svg>'
    )


def _commands(strokes: Path) -> str:
    parts = []
    for points, code in strokes.iter_segments(simplify=False):
        letter = _LETTERS.get(code)
        parts.append("Z" if letter is None else letter + " ".join(f"{at:.1f}" for at in points))
    return "".join(parts)


def _inline(writer: Any, node: nodes.math) -> None:
    writer.body.append(drawing(node.astext(), _INLINE))
    raise nodes.SkipNode


def _block(writer: Any, node: nodes.math_block) -> None:
    """One drawing a line; lines end in a double backslash."""
    lines = [
        line for line in node.astext().replace(r"\frac", r"\dfrac").split(r"\\") if line.strip()
    ]
    drawn = "".join(f"<div>{drawing(line, _BLOCK)}</div>" for line in lines)
    writer.body.append(f'<div class="math drawn-math-block">{drawn}</div>')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the renderer `drawn`."""
    app.add_html_math_renderer("drawn", (_inline, None), (_block, None))
    app.add_css_file("manual.css")
    return {"parallel_read_safe": True, "parallel_write_safe": True}
