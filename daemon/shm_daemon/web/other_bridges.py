"""Ask the dashboards of other bridges how they are: side by side, briefly, and never elsewhere."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime, timedelta
from pathlib import Path
from threading import Lock

import shm
from shm.bridge import OtherBridge
from shm.documents import ValidationError, value_of
from shm.errors import ShmError
from shm.pipeline import utc_now
from shm.values.messages import Lead
from shm_daemon.hooks.contract import one_line
from shm_daemon.http_client import HttpClient, NoAnswer
from shm_daemon.web.address import SUMMARY
from shm_daemon.web.bridge_summary import BridgeRow, Summary

# Judgement: a page takes a second, over a poor line a few; who looks at a page waits no longer.
LONGEST_S, _PAGE_WAITS_S = 10.0, 4.0
_FRESH_FOR = timedelta(seconds=15)
"""So often at most is a bridge asked: a wrong token is throttled from ten times a minute on."""
_SIDE_BY_SIDE = 32  # technical: threads; each waits for the network
_LARGEST_BYTES = 65_536  # technical: a summary has some 1,000

_LOOK = "See today that its machine and `shm web` run there, and that the address is right."
_MAKE_ONE = "Make a token with `shm token create all-bridges --scope read` there"

log = logging.getLogger(__name__)


class NotReached(ShmError):
    """A bridge did not say how it is."""


def ask(
    bridge: OtherBridge, folder: Path, client: HttpClient, timeout_s: float = LONGEST_S
) -> Summary:
    """Return the summary of another bridge; `folder` is that of our workspace.

    Raises NotReached.
    """
    headers = {"Accept": "application/json", "User-Agent": "shm", **_token(bridge, folder)}
    trusted = folder / bridge.certificate_file if bridge.certificate_file else None
    if trusted is not None and not trusted.is_file():
        raise NotReached(
            f"There is no file {bridge.certificate_file}.",
            remedy="Put the certificate of its authority there, as a PEM file.",
        )
    try:
        answer = client.send(
            "GET",
            f"{bridge.address}{SUMMARY}",
            timeout_s,
            _LARGEST_BYTES,
            headers=headers,
            verify=str(trusted) if trusted else True,
        )
    except NoAnswer as error:
        remedy = _LOOK
        if error.is_untrusted:
            remedy = "Name the certificate of its authority in bridge.toml: certificate_file."
        raise NotReached(f"No connection: {error.reason}.", remedy=remedy) from None
    return _parse(bridge, answer.status, answer.body)


def _token(bridge: OtherBridge, folder: Path) -> dict[str, str]:
    if not bridge.token_file:
        return {}
    try:
        token = (folder / bridge.token_file).read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError):
        token = ""
    if not token or not token.isprintable():
        raise NotReached(
            f"Its token cannot be read from {bridge.token_file}.",
            remedy=f"{_MAKE_ONE}, and write it alone into that file, readable for this user.",
        )
    return {"Authorization": f"Bearer {token}"}


def _parse(bridge: OtherBridge, status: int, body: bytes) -> Summary:
    """Return the summary of an answer; raises NotReached."""
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
            raise NotReached(
                f"Its shm {theirs} and this {shm.__version__} do not understand each other.",
                remedy="Upgrade the older of the two.",
            ) from None
    if status == 401 and document:
        where = bridge.token_file or "a file, and name that in bridge.toml: token_file"
        problem = f"It refuses the token of {where}" if bridge.token_file else "It asks for a token"
        raise NotReached(f"{problem}.", remedy=f"{_MAKE_ONE}. Write it into {where}.")
    if status == 200 or "message" not in document:
        raise NotReached(
            f"Something else than shm answers at its address ({status}).",
            remedy="Correct its address in bridge.toml; another that it sends to is not asked.",
        )
    problem, remedy = (one_line(str(document.get(key, ""))) for key in ("message", "remedy"))
    raise NotReached(f"It answers {status}: {problem}", remedy=remedy or _LOOK)


class OtherBridges:
    """Latest summaries of other bridges. May be used from many threads."""

    def __init__(self, timeout_s: float = _PAGE_WAITS_S, clock: Callable[[], datetime] = utc_now):
        self._timeout_s, self._clock = timeout_s, clock
        self._client, self._lock = HttpClient(), Lock()
        self._known: dict[OtherBridge, BridgeRow] = {}

    def rows(self, bridges: Sequence[OtherBridge], folder: Path) -> list[BridgeRow]:
        """Return each bridge as it is now; those that do not answer in time with the reason."""
        with self._lock:
            now = self._clock()
            fresh = {k: row for k, row in self._known.items() if now - row.asked_at < _FRESH_FOR}
            due = [each for each in dict.fromkeys(bridges) if each not in fresh]
            if due:
                with ThreadPoolExecutor(min(len(due), _SIDE_BY_SIDE), "bridges") as pool:
                    asked = pool.map(lambda each: self._ask(each, folder, now), due)
                    fresh |= zip(due, asked, strict=True)
            self._known = fresh
            return [fresh[each] for each in bridges]

    def close(self) -> None:
        """Break off what is being asked."""
        self._client.close()

    def _ask(self, bridge: OtherBridge, folder: Path, now: datetime) -> BridgeRow:
        address = f"{bridge.address}/"
        try:
            summary = ask(bridge, folder, self._client, self._timeout_s)
            return BridgeRow(bridge.name, address, summary, now)
        except NotReached as error:
            why = Lead(error.message, error.remedy)
        except Exception:
            log.exception("%s cannot be asked", bridge.name)
            why = Lead("An internal error.", "The log says more.")
        state = f"{bridge.name} is not reached: {why.state[0].lower()}{why.state[1:]}"
        return BridgeRow(bridge.name, address, None, now, Lead(state, why.action))


def ask_all(bridges: Sequence[OtherBridge], folder: Path) -> list[BridgeRow]:
    """Return all bridges asked once, as long as each may take."""
    asking = OtherBridges(LONGEST_S)
    try:
        return asking.rows(bridges, folder)
    finally:
        asking.close()
