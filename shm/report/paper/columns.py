"""How wide the columns of a table are set."""

from __future__ import annotations

from collections.abc import Sequence

from shm.report.paper import fonts
from shm.report.table import Table

_LONGEST_WORD_POINTS = 110.0
_SLACK_POINTS = 1.0


def widths(table: Table, room: float, size: float, padding: float) -> list[float]:
    """Points of each column, together at most `room`.

    Narrow columns stand on one line; the wide ones share what is left, none narrower than its
    longest word as far as there is room. Words longer than a column are broken.
    """
    columns = list(zip(table.headings, *table.rows, strict=True))
    whole = [padding + max(_width(cell, size) for cell in column) for column in columns]
    if sum(whole) <= room:
        return whole
    least = [padding + max(_longest_word(cell, size) for cell in column) for column in columns]
    if sum(least) >= room:
        return [each * room / sum(least) for each in least]
    return _shared(whole, least, room)


def _shared(whole: Sequence[float], least: Sequence[float], room: float) -> list[float]:
    """The narrow first: each gets an equal share of what is left, or less if it wants less."""
    given = list(least)
    left = room - sum(least)
    ascending = sorted(range(len(whole)), key=lambda column: whole[column] - least[column])
    for place, column in enumerate(ascending):
        more = min(whole[column] - least[column], left / (len(whole) - place))
        given[column] += more
        left -= more
    return given


def _width(cell: str, size: float) -> float:
    # Headings stand in bold, which is the wider: measured so, no cell is too narrow.
    return fonts.width(cell, fonts.BOLD, size) + _SLACK_POINTS


def _longest_word(cell: str, size: float) -> float:
    words: Sequence[str] = cell.split() or [""]
    return min(max(_width(word, size) for word in words), _LONGEST_WORD_POINTS)
