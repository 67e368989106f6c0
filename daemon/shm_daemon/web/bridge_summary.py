"""A bridge in a line: what its home page says first, as every list of bridges shows it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import datetime
from typing import Literal
from urllib.parse import quote

import shm
from shm.errors import ShmError
from shm.pipeline.bridge_reporting import hanger_summaries
from shm.report.formatting import counted, listed
from shm.report.hanger_status import QUIET, Status, bridge_message
from shm.store.alerts import count_alerts
from shm.store.recordings import list_holds
from shm.values.messages import URGENCIES, Lead, Urgency
from shm_daemon.web.health import notices, troubles
from shm_daemon.web.site import Site

NOT_REACHED, STOPPED = "Not reached", "Stopped"


@dataclass(frozen=True)
class Summary:
    """Summary of a bridge by itself.

    `notices` are what every page of its dashboard says at its top, `troubles` why its work stands
    still; `others` says which other hangers need action.
    """

    bridge: str
    version: str
    status: Literal["alert", "watch", "check", "unclear", "steady", "first"] | None
    state: str
    action: str
    urgency: Urgency
    notes: tuple[str, ...]
    others: str
    notices: tuple[Lead, ...]
    troubles: tuple[str, ...]
    hangers: int
    latest_test_at: datetime | None
    open_alerts: int
    held: int

    @property
    def words(self) -> str:
        parts = f"{self.state} {self.action}", *self.notes, self.others
        return " ".join(part for part in parts if part)


def summary_of(site: Site, now: datetime) -> Summary:
    """Return the lead of the home page of this site. Raises StoreError if the store is unusable."""
    workspace, store = site.workspace, site.store
    lines = hanger_summaries(workspace, store, now)
    message = bridge_message({each.hanger.id: each.message for each in lines})
    return Summary(
        bridge=workspace.bridge.name,
        version=shm.__version__,
        **{**message.document, "notes": message.notes},  # type: ignore[arg-type]
        others=message.others,
        notices=tuple(notices(site)),
        troubles=tuple(troubles(site)),
        hangers=len(lines),
        latest_test_at=max((each.latest.time for each in lines if each.latest), default=None),
        open_alerts=count_alerts(store)[0],
        held=len(list_holds(store)),
    )


@dataclass(frozen=True)
class BridgeRow:
    """A bridge of the list, and where its dashboard is.

    `trouble` is why it could not be asked at `asked_at`, None where it answered; then `summary` is
    what it said.
    """

    name: str
    address: str
    summary: Summary | None
    asked_at: datetime
    trouble: Lead | None = None

    @property
    def anchor(self) -> str:
        """Of its part of the page."""
        return f"bridge-{quote(self.name, safe='')}"

    @property
    def leads(self) -> tuple[Lead, ...]:
        """Return the notices before its lead: it is not reached, or its work is limited."""
        if self.summary is None:
            return (self.trouble,) if self.trouble else ()
        notices = self.summary.notices
        more = set(self.summary.troubles) - {each.state for each in notices}
        look = "See its page Operation today."
        return (*(Lead(each, look) for each in sorted(more)), *notices)

    @property
    def states(self) -> tuple[tuple[str, str], ...]:
        """Return its state in a word or two, each with its style; empty before its first test.

        What is not watched is never quiet, whatever its last tests said.
        """
        if self.summary is None:
            return ((NOT_REACHED, "alert"),)
        status = Status[self.summary.status.upper()] if self.summary.status else None
        status_word = ((status.value, status.name.lower()),) if status else ()
        if self.is_watched:
            return status_word
        return ((STOPPED, "alert"), *(status_word if status not in QUIET else ()))

    @property
    def is_watched(self) -> bool:
        """Return True if it answered and its work goes on; else it is never quiet."""
        return self.summary is not None and not self.summary.troubles

    @property
    def urgency(self) -> Urgency:
        """Of the whole row: a bridge that nobody watches wants somebody today."""
        return self.summary.urgency if self.summary and self.is_watched else "today"

    @property
    def group(self) -> str:
        """Return what it needs in words, by which the list is grouped."""
        if self.summary is None:
            return NOT_REACHED
        is_quiet = self.summary.urgency == "none"
        return STOPPED if is_quiet and not self.is_watched else _GROUPS[self.summary.urgency]


def site_rows(site: Site, now: datetime) -> tuple[BridgeRow, ...]:
    """Return the row of the site's bridge; empty where it describes none and only lists others.

    A store that fails is shown like a bridge that is not reached.
    """
    bridge = site.workspace.bridge
    if not bridge.watched and bridge.other_bridges:
        return ()
    try:
        return (BridgeRow(bridge.name, "/", summary_of(site, now), now),)
    except ShmError as error:
        lead = Lead(f"{bridge.name} cannot be read: {error.message}", error.remedy)
        return (BridgeRow(bridge.name, "/", None, now, lead),)


def row_document(row: BridgeRow) -> dict[str, object]:
    """Return a row as `shm bridges --json` and `/api/bridges` give it."""
    return {
        "name": row.name,
        "address": row.address,
        "states": [word for word, _ in row.states],
        "urgency": row.urgency,
        "trouble": row.trouble and asdict(row.trouble),
        "asked_at": row.asked_at,
        "summary": row.summary and asdict(row.summary),
    }


_ORDER = [status.name.lower() for status in Status]
_GROUPS = {
    "today": "Action today",
    "week": "Action within a week",
    "next_test": "Action at the next planned test",
    "none": "No action before the next planned test",
}


def worst_first(rows: Sequence[BridgeRow]) -> tuple[BridgeRow, ...]:
    """Sort rows by urgency, then state, then whether they are watched, then as given."""

    def rank(row: BridgeRow) -> tuple[int, int, bool]:
        status = row.summary and row.summary.status
        place = _ORDER.index(status) if status else len(_ORDER)
        return -URGENCIES.index(row.urgency), place, row.is_watched

    return tuple(sorted(rows, key=rank))


def groups(rows: Sequence[BridgeRow]) -> dict[str, tuple[BridgeRow, ...]]:
    """Group bridges by the action they need, most urgent first."""
    titles = dict.fromkeys((_GROUPS["today"], NOT_REACHED, STOPPED, *_GROUPS.values()))
    found = {title: tuple(e for e in worst_first(rows) if e.group == title) for title in titles}
    return {title: of for title, of in found.items() if of}


def headline(rows: Sequence[BridgeRow]) -> str:
    """Return a sentence: how many bridges there are, and which of them need what."""
    found = groups(rows).items()
    sentences = (f"{key}: {listed([each.name for each in of])}." for key, of in found)
    return " ".join((f"{counted(len(rows), 'bridge')}.", *sentences))
