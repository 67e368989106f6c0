"""The templates of the pages."""

from __future__ import annotations

import re

from jinja2 import BaseLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

_COMMAND = re.compile(r"`([^`]+)`")
_CODE = Markup("<code>{}</code>")


def with_code(text: str) -> Markup:
    """The text for a page; what stands between backticks, as commands do, is code."""
    return Markup().join(
        _CODE.format(part) if index % 2 else escape(part)
        for index, part in enumerate(_COMMAND.split(text))
    )


def environment(loader: BaseLoader) -> Environment:
    """How all pages are made from their templates."""
    made = Environment(
        loader=loader,
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters["with_code"] = with_code
    return made


ENVIRONMENT = environment(PackageLoader("shm.report", "templates"))
