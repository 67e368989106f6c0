"""Results to the databases of `[[publish]]`: queued on disk, then posted until each is taken.

In a thread of its own. A database that is down, or refuses, is tried again for ever and stops
nobody; points are the same however often they are sent: record 0027.
"""

from __future__ import annotations

import base64
import json
import logging
import os
import time
from collections.abc import Mapping, Sequence
from http import HTTPStatus

from shm.bridge.publish import Publication
from shm.errors import ShmError
from shm.pipeline import Clock
from shm.pipeline.publishing import Progress, queue_results
from shm.store import Workspace
from shm.store.point_outbox import PointOutbox, WaitingPoint
from shm_daemon.background import Background
from shm_daemon.hooks.contract import SHOWN_CHARACTERS, one_line, read_secret
from shm_daemon.http_client import HttpClient, NoAnswer

_POINTS_REFUSED = (
    HTTPStatus.BAD_REQUEST,
    HTTPStatus.REQUEST_ENTITY_TOO_LARGE,
    HTTPStatus.UNPROCESSABLE_ENTITY,
)


_AT_ONCE = 5000  # lines of one post: InfluxData's own advice

log = logging.getLogger(__name__)


class NotTaken(ShmError):
    """A database took nothing of what it was sent; another try may help."""


class PointsRefused(ShmError):
    """A database refused at least one of the points, and says why; others it may have stored."""


def token_of(publication: Publication, workspace: Workspace, environment: Mapping[str, str]) -> str:
    """Return the token, empty where none is named; raises NotTaken where it cannot be read."""
    where = publication.token_file or f"the variable {publication.token_env}"
    found = environment.get(publication.token_env, "").strip()
    if publication.token_file:
        found = read_secret(workspace.folder, publication.token_file, NotTaken)
    if publication.needs_token and (not found or not found.isprintable()):
        raise NotTaken(f"{where} holds no token.", remedy="Write the token there.")
    return found


def post(
    publication: Publication, token: str, lines: Sequence[str], client: HttpClient, timeout_s: float
) -> None:
    """Post lines of the line protocol; raises NotTaken or PointsRefused."""
    headers = {"Content-Type": "text/plain; charset=utf-8", "User-Agent": "shm"}
    if token and publication.bucket:
        headers["Authorization"] = f"Token {token}"
    elif token:
        headers["Authorization"] = f"Basic {base64.b64encode(token.encode()).decode()}"
    url, data = publication.write_url, "\n".join(lines).encode()
    try:
        answer = client.send("POST", url, timeout_s, SHOWN_CHARACTERS, data=data, headers=headers)
    except NoAnswer as error:
        remedy = "See that it runs, and that url is right."
        raise NotTaken(f"{publication.url}: {error.reason}.", remedy=remedy) from None
    if answer.status != HTTPStatus.NO_CONTENT:
        raise _refusal(publication, answer.status, answer.body)


def _refusal(publication: Publication, status: int, words: bytes) -> ShmError:
    try:
        document = json.loads(words)
        answer = document.get("error") or document.get("message") or ""
    except (ValueError, AttributeError):
        answer = words.decode(errors="replace")
    place = f"bucket {publication.bucket}" if publication.bucket else publication.database
    remedy = {
        401: "Correct the token in the file or variable that [[publish]] names.",
        403: f"Let its token write to {place}.",
        404: f"Create {place} there, or correct its name in [[publish]].",
    }.get(status, "See its log.")
    if 200 <= status < 300:
        answer = "not the 204 by which a database says that it has stored the points"
        remedy = "See that url is the database itself, and not a login page or proxy."
    if 300 <= status < 400:
        remedy = "It is not followed: write the address that it sends to into [[publish]]."
    kind = PointsRefused if status in _POINTS_REFUSED else NotTaken
    message = f"{publication.url} answered {status}: {one_line(str(answer)) or 'no message'}."
    return kind(message, remedy=remedy)


class Publisher(Background):
    """One turn after the other: what is new into the outbox, what waits to the databases."""

    name = "publish"

    def __init__(
        self,
        workspace: Workspace,
        clock: Clock,
        pause_s: float = 10.0,
        retry_s: float = 60.0,
    ):
        super().__init__(workspace, clock, pause_s, retry_s)
        self._client, self._outbox = HttpClient(), PointOutbox(workspace.folder)
        self._progress: dict[str, Progress] = {}
        self._retry_at: dict[str, float] = {}

    def use(self, workspace: Workspace) -> None:
        """Take a changed description over, and try at once what it may have corrected."""
        super().use(workspace)
        self._retry_at.clear()
        self._progress.clear()

    def turn(self) -> None:
        """Queue what is new for each database, and post what waits where it is time to try."""
        for publication in self._workspace.bridge.publications:
            name = publication.name
            if name not in self._progress:
                self._progress[name] = Progress()
                self._outbox.retry_refused(name)
            now, progress = self._clock(), self._progress[name]
            queue_results(self._outbox, name, self._workspace, self._store, now, progress)
            if time.monotonic() >= self._retry_at.get(name, 0.0):
                self._deliver(publication)

    def break_off(self) -> None:
        """End what is being sent; it is sent again."""
        self._client.close()

    def _deliver(self, publication: Publication) -> None:
        """Post all that waits; note and log why where it is not taken."""
        name, before = publication.name, self._outbox.state(publication.name).why
        try:
            token = token_of(publication, self._workspace, os.environ)
            while waiting := self._outbox.list_waiting(name, _AT_ONCE):
                refusals = self._post_in_parts(publication, token, waiting)
                if refusals:
                    found = f"{len(refusals)} of {len(waiting)} points were refused"
                    log.warning("publish %s: %s, the first: %s", name, found, refusals[0])
        except NotTaken as error:
            why = f"{error.message} {error.remedy}"
            self._retry_at[name] = time.monotonic() + self.retry_s
        else:
            why = ""
        if why != before and not self._client.closed:
            self._outbox.note_failure(name, why, self._clock())
            log.warning("publish %s: %s", name, why) if why else log.info("publish %s: works", name)

    def _post_in_parts(
        self, publication: Publication, token: str, points: Sequence[WaitingPoint]
    ) -> list[PointsRefused]:
        """Post points, halved while some are refused; return the refusal of each that is left."""
        timeout_s = self._workspace.settings.hook_timeout_seconds
        try:
            post(publication, token, [each.line for each in points], self._client, timeout_s)
        except PointsRefused as error:
            if len(points) > 1:
                half = len(points) // 2
                first = self._post_in_parts(publication, token, points[:half])
                return first + self._post_in_parts(publication, token, points[half:])
            self._outbox.mark(points, "refused")
            return [error]
        self._outbox.mark(points, "taken")
        return []
