"""Limits of connections: a caller must send its request soon.

Uvicorn counts connections, not requests, and sets no deadline to a caller that connects and falls
silent, or drips in a byte at a time. Here a connection *waits* until its request has come as a
whole, and again once that is answered. Who waits too long is cut off; where too many wait, those
that have waited longest make room, first of the same address, so that a new caller always gets in.
Before them go those that were answered and have not sent all that they asked with: a thousand slow
uploads that are refused at once would else push out who has just come.
"""

from __future__ import annotations

import asyncio
import fcntl
import logging
import socket
import ssl
import struct
import termios
from array import array
from collections import OrderedDict, defaultdict
from contextlib import suppress
from typing import Any, ClassVar

from uvicorn.protocols.http.h11_impl import H11Protocol

from shm_daemon.web.address import network_of
from shm_daemon.web.middleware import is_upload

DEADLINE_S = 10.0
"""From the first moment to the last byte of a request that is no upload; also for TLS to begin."""
FROM_AN_ADDRESS = 64
"""So many may wait from one address: a browser holds six, a proxy keeps some tens open."""
FROM_ALL = 4 * FROM_AN_ADDRESS  # technical: with the largest headers 4 MB of memory
_LEAST_PROGRESS_BYTES = 10_000
"""Who takes this much of a long answer before each deadline may take it to the end."""

log = logging.getLogger(__name__)


class ConnectionLimits:
    """All connections that wait, by address, in the order in which they began to."""

    def __init__(self, certificate: ssl.SSLContext | None = None):
        self.certificate = certificate
        self._waiting: OrderedDict[LimitedProtocol, str] = OrderedDict()
        self._of_address: defaultdict[str, OrderedDict[LimitedProtocol, None]] = defaultdict(
            OrderedDict
        )

    def waits(self, one: LimitedProtocol, address: str, *, makes_room: bool) -> None:
        """Register a waiting connection; where too many wait, cut one off.

        That is the first that `makes_room`, else the one that has waited longest.
        """
        same = self._of_address[address]
        self._waiting[one], same[one] = address, None
        if makes_room:
            self._waiting.move_to_end(one, last=False)
            same.move_to_end(one, last=False)
        if len(same) > FROM_AN_ADDRESS:
            self._cut_off(next(iter(same)))
        elif len(self._waiting) > FROM_ALL:
            self._cut_off(next(iter(self._waiting)))

    def leaves(self, one: LimitedProtocol) -> None:
        """Remove a connection that is answered or gone from those that wait."""
        address = self._waiting.pop(one, None)
        if address is None:
            return
        same = self._of_address[address]
        del same[one]
        if not same:
            del self._of_address[address]

    def _cut_off(self, one: LimitedProtocol) -> None:
        self.leaves(one)
        one.cut_off()


class LimitedProtocol(H11Protocol):
    """One connection; `door` is that of its server."""

    door: ClassVar[ConnectionLimits]

    def __init__(self, *args: Any, **options: Any):
        super().__init__(*args, **options)
        self._plain: asyncio.Transport | None = None
        self._early = b""
        self._deadline: asyncio.TimerHandle | None = None
        self._unsent_bytes = 0
        self._address = ""
        self._beginning: asyncio.Task[None] | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        self._plain = transport
        self._address = _address(transport)
        self._wait()
        if self.door.certificate is None:
            super().connection_made(transport)
            return
        transport.pause_reading()
        self._beginning = self.loop.create_task(self._begin_tls(transport, self.door.certificate))

    async def _begin_tls(self, transport: asyncio.Transport, context: ssl.SSLContext) -> None:
        """Start TLS here: asyncio would wait for a minute without counting the connection."""
        try:
            secured = await self.loop.start_tls(
                transport, self, context, server_side=True, ssl_handshake_timeout=DEADLINE_S
            )
        except OSError as error:  # of which ssl.SSLError is a kind
            log.debug("TLS could not begin: %s", error)
            secured = None
        if secured is None:
            transport.abort()
            return
        super().connection_made(secured)
        if self._early:
            self.data_received(self._early)

    def data_received(self, data: bytes) -> None:
        if self.flow is None:  # TLS has just begun
            self._early += data
            return
        super().data_received(data)
        self._look()

    def on_response_complete(self) -> None:
        super().on_response_complete()
        self._look()

    def connection_lost(self, exc: Exception | None) -> None:
        self._stop_waiting()
        if self.flow is not None:
            super().connection_lost(exc)

    def cut_off(self) -> None:
        """End it without a word: who does not ask is not answered."""
        self._stop_waiting()
        if self._plain is not None:
            # Else the system would keep what is unsent, and try for minutes to deliver it.
            self._plain.get_extra_info("socket").setsockopt(
                socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0)
            )
            self._plain.abort()

    def _look(self) -> None:
        """Check if the connection waits, or is being answered."""
        cycle = self.cycle
        asked = cycle is not None and not cycle.response_complete
        if asked and (not cycle.more_body or is_upload(self.scope)):
            self._stop_waiting()
        elif self._deadline is None and not self.transport.is_closing():
            self._wait()

    def _wait(self) -> None:
        self._deadline = self.loop.call_later(DEADLINE_S, self._overdue)
        refused = self.cycle is not None and self.cycle.response_complete and self.cycle.more_body
        self.door.waits(self, self._address, makes_room=refused)

    def _stop_waiting(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None
        self.door.leaves(self)

    def _overdue(self) -> None:
        """Close a connection whose time is over, unless it still receives a long answer."""
        before, self._unsent_bytes = self._unsent_bytes, self._unsent()
        is_taken = self._unsent_bytes > 0 and (
            before == 0 or before - self._unsent_bytes >= _LEAST_PROGRESS_BYTES
        )
        if is_taken:
            self._deadline = self.loop.call_later(DEADLINE_S, self._overdue)
        else:
            self.cut_off()

    def _unsent(self) -> int:
        """Return the bytes that the caller has not received, buffers of the system included."""
        if self.transport is None or self._plain is None:
            return 0
        queued = array("i", [0])
        with suppress(OSError):  # another system may not tell
            fcntl.ioctl(self._plain.get_extra_info("socket").fileno(), termios.TIOCOUTQ, queued)
        return self.transport.get_write_buffer_size() + queued[0]


def guarded_by(door: ConnectionLimits) -> type[LimitedProtocol]:
    """Return the protocol of a server with that door."""
    return type("LimitedProtocol", (LimitedProtocol,), {"door": door})


def _address(transport: asyncio.BaseTransport) -> str:
    peer = transport.get_extra_info("peername")
    return network_of(str(peer[0])) if isinstance(peer, tuple) else ""
