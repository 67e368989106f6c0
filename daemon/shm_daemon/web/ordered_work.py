"""Long work that a page has ordered: the page shows that it goes on, and may be left."""

from __future__ import annotations

import secrets
import time
from collections import OrderedDict
from dataclasses import dataclass
from typing import Any

from fastapi import Request, Response
from fastapi.responses import HTMLResponse

from shm.errors import NothingThere, ShmError
from shm_daemon.web.background_work import RETRY_AFTER, BackgroundWorker, WorkRequest

_MOST_REMEMBERED = 50  # technical: outcomes that a page may still ask for


@dataclass
class _Ordered:
    """One order: since when it is waited for, and what came of it."""

    order: WorkRequest
    begun_s: float
    outcome: object = None


class OrderedWork:
    """Remembers orders by the word that their page asks with."""

    def __init__(self, worker: BackgroundWorker[Any]):
        self._worker = worker
        self._ordered: OrderedDict[str, _Ordered] = OrderedDict()

    def place(self, order: WorkRequest) -> str:
        """Have an order worked out, and return its word."""
        word = secrets.token_urlsafe(9)
        self._worker.get_or_start(order)
        self._ordered[word] = _Ordered(order, time.monotonic())
        while len(self._ordered) > _MOST_REMEMBERED:
            self._ordered.popitem(last=False)
        return word

    def outcome(self, word: str, remedy: str) -> object | None:
        """Return what came of an order, None while it is worked out.

        Raises the ShmError with which it failed, NothingThere with a remedy for an unknown word.
        """
        found = self._ordered.get(word)
        if found is None:
            raise NothingThere("this order is not known any more.", remedy=remedy)
        if found.outcome is None:
            try:
                found.outcome = self._worker.get_or_start(found.order)
            except ShmError as error:
                found.outcome = error
        if isinstance(found.outcome, ShmError):
            raise found.outcome.with_traceback(None)
        return found.outcome

    def seconds(self, word: str) -> float:
        """Return for how long an order is waited for."""
        found = self._ordered.get(word)
        return time.monotonic() - found.begun_s if found else 0.0


def ordered_work_of(request: Request) -> OrderedWork:
    """Return what the pages of the app have ordered."""
    found: OrderedWork = request.app.state.ordered_work
    return found


def still_at_work(text: str) -> Response:
    """Return the answer that asks the page to come again."""
    return HTMLResponse(f'<p class="note" role="status">{text}</p>', 202, RETRY_AFTER)
