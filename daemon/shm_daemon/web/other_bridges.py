"""Asks the dashboards of other bridges how they are: side by side, briefly, and never elsewhere.

What a bridge said last is kept in memory, with its age, for when it cannot be asked.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path
from threading import Lock

import shm
from shm.bridge import OtherBridge
from shm.documents import ValidationError, value_of
from shm.errors import ShmError
from shm.pipeline import utc_now
from shm.values.messages import Lead
from shm_daemon.heartbeat import duration_words
from shm_daemon.hooks.contract import one_line
from shm_daemon.http_client import HttpClient, NoAnswer
from shm_daemon.web.address import SUMMARY
from shm_daemon.web.bridge_summary import BridgeRow, Summary

# Judgement: a page takes a second, over a poor line a few; who looks at a page waits no longer.
LONGEST_S = 10.0
_PAGE_WAITS_S = 4.0
_FRESH_FOR = timedelta(seconds=15)
"""So often at most is a bridge asked: a wrong token is throttled from ten times a minute on."""
_SIDE_BY_SIDE = 32  # technical: threads; each waits for the network
_LARGEST_BYTES = 65_536  # technical: a summary has some 1,000, with every hanger's damage 20,000

_LOOK = "See today that its machine and `shm web` run there, and that the address is right."
_MAKE_ONE = "Make a token with `shm token create all-bridges --scope read` there"


log = logging.getLogger(__name__)


class NotTold(ShmError):
    """A bridge did not say how it is."""


def ask(
    bridge: OtherBridge, folder: Path, client: HttpClient, timeout_s: float = LONGEST_S
) -> Summary:
    """Return the summary of another bridge; `folder` is that of our workspace. Raises NotTold."""
    headers = {"Accept": "application/json", "User-Agent": "shm", **_token(bridge, folder)}
    try:
        answer = client.send(
            "GET",
            f"{bridge.address}{SUMMARY}",
            timeout_s,
            _LARGEST_BYTES,
            headers=headers,
            verify=_certificate(bridge, folder),
        )
    except NoAnswer as error:
        raise _failure(error) from None
    if answer.is_cut:
        raise _no_shm(f"more than {_LARGEST_BYTES // 1024} kB")
    return _judged(bridge, answer.status, answer.body)


def _token(bridge: OtherBridge, folder: Path) -> dict[str, str]:
    if not bridge.token_file:
        return {}
    try:
        token = (folder / bridge.token_file).read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError):
        token = ""
    if not token or not token.isprintable():
        raise NotTold(
            f"Its token cannot be read from {bridge.token_file}.",
            remedy=f"{_MAKE_ONE}, and write it alone into that file, readable for this user.",
        )
    return {"Authorization": f"Bearer {token}"}


def _certificate(bridge: OtherBridge, folder: Path) -> str | bool:
    if not bridge.certificate_file:
        return True
    path = folder / bridge.certificate_file
    if not path.is_file():
        raise NotTold(
            f"There is no file {bridge.certificate_file}.",
            remedy="Put the certificate of its authority there, as a PEM file.",
        )
    return str(path)


def _failure(error: NoAnswer) -> NotTold:
    if error.is_late:
        return NotTold(f"{error.reason.capitalize()}.", remedy=_LOOK)
    if error.is_untrusted:
        return NotTold(
            f"Its certificate is not trusted ({error.reason}).",
            remedy="Have it renewed or, where an authority of your own made it, name that "
            "authority's certificate in bridge.toml: certificate_file.",
        )
    return NotTold(f"The connection failed ({error.reason}).", remedy=_LOOK)


def _judged(bridge: OtherBridge, status: int, body: bytes) -> Summary:
    """Return the summary of an answer; raises NotTold."""
    try:
        found = json.loads(body)
    except (ValueError, RecursionError):
        found = None
    document = found if isinstance(found, dict) else {}
    if status == 200 and "version" in document:
        try:
            return value_of(Summary, document)
        except ValidationError:
            theirs = one_line(str(document["version"]))[:20]
            raise NotTold(
                f"Its shm {theirs} and this {shm.__version__} do not understand each other.",
                remedy="Upgrade the older of the two.",
            ) from None
    if 300 <= status < 400:
        remedy = "It is not followed: write the dashboard's own address into bridge.toml."
        raise NotTold("Its address sends elsewhere.", remedy=remedy)
    if status == 200 or "message" not in document:
        raise _no_shm(f"{status}")
    if status == 401:
        problem, where = "It asks for a token", "a file, and name that in bridge.toml: token_file"
        if bridge.token_file:
            problem, where = f"It refuses the token of {bridge.token_file}", bridge.token_file
        raise NotTold(f"{problem}.", remedy=f"{_MAKE_ONE}. Write it into {where}.")
    if status == 404:
        raise NotTold("Its shm is older than this one.", remedy=f"Upgrade it to {shm.__version__}.")
    problem, remedy = (one_line(str(document.get(key, ""))) for key in ("message", "remedy"))
    raise NotTold(f"It answers {status}: {problem}", remedy=remedy or _LOOK)


def _no_shm(answered: str) -> NotTold:
    return NotTold(
        f"Something else than shm answers at its address ({answered}).",
        remedy="Correct its address in bridge.toml.",
    )


@dataclass(frozen=True)
class _Known:
    """State of another bridge; `failing_since` is None if it answered the last time."""

    asked_at: datetime
    summary: Summary | None = None
    answered_at: datetime | None = None
    failing_since: datetime | None = None
    why: Lead | None = None


class OtherBridges:
    """Latest summaries of other bridges. May be used from many threads."""

    def __init__(
        self,
        timeout_s: float = LONGEST_S,
        page_waits_s: float = _PAGE_WAITS_S,
        clock: Callable[[], datetime] = utc_now,
    ):
        self._timeout_s, self._page_waits_s, self._clock = timeout_s, page_waits_s, clock
        self._client, self._lock = HttpClient(), Lock()
        self._pool = ThreadPoolExecutor(_SIDE_BY_SIDE, "bridges")
        self._known: dict[OtherBridge, _Known] = {}
        self._asking: dict[OtherBridge, Future[None]] = {}

    def rows(self, bridges: Sequence[OtherBridge], folder: Path) -> list[BridgeRow]:
        """Return each bridge as it is now or, if it does not answer in time, as it was last."""
        now = self._clock()
        with self._lock:
            for each in bridges:
                known = self._known.get(each)
                is_due = known is None or now - known.asked_at >= _FRESH_FOR
                if is_due and each not in self._asking:
                    self._asking[each] = self._pool.submit(self._note, each, folder, now)
            asked = [self._asking[each] for each in bridges if each in self._asking]
        wait(asked, self._page_waits_s)
        with self._lock:
            return [self._row(each, self._known.get(each), now) for each in bridges]

    def close(self) -> None:
        """Break off what is being asked."""
        self._client.close()
        self._pool.shutdown(wait=False, cancel_futures=True)

    def _note(self, bridge: OtherBridge, folder: Path, now: datetime) -> None:
        try:
            summary = ask(bridge, folder, self._client, self._timeout_s)
            found, why = _Known(now, summary, self._clock()), None
        except NotTold as error:
            found, why = _Known(now), Lead(error.message, error.remedy)
        except Exception:
            log.exception("%s cannot be asked", bridge.name)
            found, why = _Known(now), Lead("An internal error.", "The log says more.")
        with self._lock:
            before = self._known.get(bridge)
            if why is not None:
                since = (before and before.failing_since) or now
                found = replace(before or found, asked_at=now, failing_since=since, why=why)
            self._known[bridge] = found
            del self._asking[bridge]

    def _row(self, bridge: OtherBridge, known: _Known | None, now: datetime) -> BridgeRow:
        why = known.why if known else None
        if why is None and bridge in self._asking:
            why = Lead(
                f"No answer within {self._page_waits_s:g} s.",
                "It is still being asked: open this page again in some seconds.",
            )
        trouble = _lead(bridge, known, why, now) if why else None
        answered_at = known.answered_at if known else None
        return BridgeRow(
            bridge.name,
            f"{bridge.address}/",
            known.summary if known else None,
            answered_at,
            trouble,
        )


def _lead(bridge: OtherBridge, known: _Known | None, why: Lead, now: datetime) -> Lead:
    """Return the message that a bridge is not reached, since when and why."""
    since = "is not reached"
    if known and known.answered_at:
        since = f"has not been reached for {duration_words(now - known.answered_at)}"
    elif known and known.failing_since and now - known.failing_since > _FRESH_FOR:
        since = f"has not been reached for at least {duration_words(now - known.failing_since)}"
    return Lead(f"{bridge.name} {since}: {why.state[0].lower()}{why.state[1:]}", why.action)


def ask_all(bridges: Sequence[OtherBridge], folder: Path) -> list[BridgeRow]:
    """Return all bridges asked once, as long as each may take."""
    asking = OtherBridges(page_waits_s=LONGEST_S + 1.0)
    try:
        return asking.rows(bridges, folder)
    finally:
        asking.close()
