"""Who comes with wrong tokens too often has to wait, and is named in the log."""

from __future__ import annotations

import hashlib
import logging
import threading
import time
from collections import OrderedDict
from collections.abc import Callable

from shm_daemon.web.address import network_of

MOST_WRONG, WITHIN_S = 10, 60.0
"""A person mistypes a few; a program with an old token comes again and again."""
_ADDRESSES_KEPT, _PROVEN_KEPT = 4096, 1024

log = logging.getLogger(__name__)


class WrongTokens:
    """How many have come lately, by address. May be used from many threads.

    A token that was right before is let through from an address that has to wait: a logger with an
    old token must not shut out its neighbours behind the same gateway. Memory is bounded: of many
    addresses, those seen longest ago are forgotten.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic):
        self._clock, self._lock = clock, threading.Lock()
        self._wrong: OrderedDict[str, tuple[float, int]] = OrderedDict()
        self._proven: OrderedDict[bytes, None] = OrderedDict()

    def wait_s(self, address: str, secret: str) -> float:
        """How long the address has to wait until this token is looked at; 0 where not at all."""
        with self._lock:
            began, times = self._wrong.get(network_of(address), (0.0, 0))
            if times < MOST_WRONG or _digest(secret) in self._proven:
                return 0.0
            return max(0.0, began + WITHIN_S - self._clock())

    def note_wrong(self, address: str) -> None:
        """A token from there was wrong or revoked."""
        network, now = network_of(address), self._clock()
        with self._lock:
            began, times = self._wrong.pop(network, (now, 0))
            if now - began >= WITHIN_S:
                began, times = now, 0
            self._wrong[network] = (began, times + 1)
            while len(self._wrong) > _ADDRESSES_KEPT:
                self._wrong.popitem(last=False)
        log.warning("a token from %s is wrong or revoked", address)
        if times + 1 == MOST_WRONG:
            log.warning(
                "%d wrong tokens came from %s within %.0f s: it has to wait",
                MOST_WRONG, address, WITHIN_S,
            )  # fmt: skip

    def note_right(self, secret: str) -> None:
        """This token is in force."""
        digest = _digest(secret)
        with self._lock:
            self._proven.pop(digest, None)
            self._proven[digest] = None
            while len(self._proven) > _PROVEN_KEPT:
                self._proven.popitem(last=False)


def _digest(secret: str) -> bytes:
    return hashlib.sha256(secret.encode("utf-8", "surrogatepass")).digest()
