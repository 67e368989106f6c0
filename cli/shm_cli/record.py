"""What a person says for the record: never an empty text, which nobody could make use of later."""

from __future__ import annotations

import rich_click as click


class Words(click.ParamType[str]):
    """A text with something in it."""

    name = "text"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """The text without blanks around it; refuses an empty one."""
        if not value.strip():
            self.fail("it is empty. Say it in a few words.", param, ctx)
        return value.strip()
