"""A paper as one HTML file: style, figures and words inside, nothing fetched.

Readable on screen (light or dark), on paper, by ear.
"""

from __future__ import annotations

import re
from typing import Any

from jinja2 import BaseLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from shm.report.paper import Paper, Table
from shm.values.rounding import unbroken

_COMMAND = re.compile(r"`([^`]+)`")
_CODE = Markup("<code>{}</code>")


def as_html(paper: Paper) -> str:
    """Return the document; its figures are SVG elements whose colours follow the page's."""
    return ENVIRONMENT.get_template("paper.html.j2").render(paper=paper)


def table_html(table: Table) -> str:
    """Return one table by itself, as a notebook shows it."""
    parts: Any = ENVIRONMENT.get_template("paper_parts.html.j2").module
    return str(parts.render(table))


def with_code(text: str) -> Markup:
    """Return the text for a page; what stands between backticks, as commands do, is code."""
    return Markup().join(
        _CODE.format(part) if index % 2 else escape(part)
        for index, part in enumerate(_COMMAND.split(unbroken(text)))
    )


def _anchor(title: str) -> str:
    """Return a title as anchor: `In short` as `in-short`."""
    return "-".join(re.findall(r"\w+", title.lower()))


def _as_markup(drawing: str) -> Markup:
    # Drawn by us; words from outside that stand in it are escaped there.
    return Markup(drawing)  # noqa: S704


def environment(loader: BaseLoader) -> Environment:
    """Return the environment that makes all pages from their templates."""
    made = Environment(
        loader=loader,
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters.update(with_code=with_code, anchor=_anchor, as_markup=_as_markup)
    return made


ENVIRONMENT = environment(PackageLoader("shm.report", "templates"))
