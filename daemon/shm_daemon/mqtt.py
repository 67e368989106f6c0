"""Recordings by MQTT: topic `shm/<bridge>/<hanger>[/<file name>]`, the payload is the file.

Topic `shm/<bridge>/stream/<name>` is for chunks of permanent sensors: acknowledged once on disk.

A message lands in the spool as an upload does, and is acknowledged once it is on disk there: a
daemon or a broker killed before that has it sent again. Protocol 3.1.1, which every broker speaks,
with a session that the broker keeps while the daemon is down.

One message at a time is in memory. While it cannot land no other is read from the connection, so
that the broker keeps them; one that gives the connection up sends them again on the next.
"""

from __future__ import annotations

import logging
import os
import re
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote, urlsplit

from shm.errors import BadInput, ShmError, TooLarge, needing, retry_pause_s
from shm.pipeline import utc_now
from shm.pipeline.faults import move_to_quarantine
from shm.read import FORMATS
from shm.store import Store, Workspace
from shm.store.archive import MODES_SUFFIX, refuse_oversize
from shm.store.recordings import find_by_checksum
from shm_daemon.spool import incoming, landing_name
from shm_daemon.streams import take_chunks
from shm_daemon.web.site import Description

if TYPE_CHECKING:
    from paho.mqtt.client import Client, MQTTMessage

PASSWORD_VARIABLE = "SHM_MQTT_PASSWORD"  # noqa: S105
_PORTS = {"mqtt": 1883, "mqtts": 8883}
_RETRY_S = 5.0
_LONGEST_RETRY_S = 120
_HEAD_BYTES = 4096
_STREAM = "stream"  # no hanger: the level of the topics of chunks

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Broker:
    """Address of the broker and our user there."""

    host: str
    port: int
    encrypted: bool
    user: str = ""
    password: str = field(default="", repr=False)

    @classmethod
    def of(cls, url: str, environment: Mapping[str, str]) -> Broker:
        """The broker of a setting `mqtt_url`; raises BadInput. The password is never in it."""
        try:
            parts = urlsplit(url)
            port = parts.port or _PORTS.get(parts.scheme, 0)
        except ValueError:
            raise _bad_url("is no address of a broker") from None
        if parts.password is not None:
            raise _bad_url("holds a password, which would stand in files and logs")
        if parts.scheme not in _PORTS or not parts.hostname or parts.path not in ("", "/"):
            raise _bad_url("is no address of a broker")
        user, encrypted = unquote(parts.username or ""), parts.scheme == "mqtts"
        return cls(parts.hostname, port, encrypted, user, environment.get(PASSWORD_VARIABLE, ""))


def topic_of(bridge_name: str) -> str:
    """The part of the topics that all recordings of a bridge share: `shm/arch-bridge`."""
    plain = re.sub(r"[^a-z0-9]+", "-", bridge_name.lower()).strip("-")
    return f"shm/{plain or 'bridge'}"


@contextmanager
def messages(workspace: Workspace) -> Iterator[None]:
    """Takes messages in while the context lasts; without a setting `mqtt_url`, does nothing.

    For the holder of the workspace's lock. A broker that is down or refuses us is tried again for
    ever and stops nobody. Raises BadInput for a wrong `mqtt_url`, UsageError where the extra
    `[mqtt]` is not installed.
    """
    url = workspace.settings.mqtt_url
    if not url:
        yield
        return
    listener = Listener(workspace, Broker.of(url, os.environ))
    listener.begin()
    try:
        yield
    finally:
        listener.end()


class Listener:
    """One connection, whose thread takes a message after the other and acknowledges it."""

    def __init__(self, workspace: Workspace, broker: Broker):
        self._workspace, self._broker = workspace, broker
        self._description = Description(workspace)  # streams may be added while we run
        self._topic = topic_of(workspace.bridge.name)
        self._ended = threading.Event()
        self._store: Store | None = None
        self._client = self._make_client()
        self.connected = False
        """Whether the broker has accepted our subscription."""

    def begin(self) -> None:
        """Connects, or goes on trying, and returns at once."""
        self._client.connect_async(self._broker.host, self._broker.port, keepalive=30)
        self._client.loop_start()

    def end(self) -> None:
        """End; the broker sends again what is not acknowledged by now."""
        self._ended.set()
        self._client.disconnect()
        self._client.loop_stop()
        if self._store is not None:
            self._store.close()

    def _make_client(self) -> Client:
        with needing("mqtt"):
            from paho.mqtt.client import Client
            from paho.mqtt.enums import CallbackAPIVersion
        # The same name each time, or the broker would keep a session for nobody.
        name = self._topic.replace("/", "-")
        client = Client(
            CallbackAPIVersion.VERSION2, client_id=name, clean_session=False, manual_ack=True
        )
        if self._broker.encrypted:
            client.tls_set()
        if self._broker.user:
            client.username_pw_set(self._broker.user, self._broker.password or None)
        client.reconnect_delay_set(1, _LONGEST_RETRY_S)
        client.on_connect, client.on_disconnect = self._connected, self._disconnected
        client.on_subscribe, client.on_message = self._granted, self._heard
        return client

    def _connected(self, client: Client, _: Any, flags: Any, reason: Any, properties: Any) -> None:
        if reason.is_failure:
            log.warning("the broker %s refuses us: %s", self._broker.host, reason)
        else:
            client.subscribe([(f"{self._topic}/+", 1), (f"{self._topic}/+/+", 1)])

    def _granted(self, client: Client, _: Any, mid: int, reasons: Any, properties: Any) -> None:
        if any(reason.is_failure for reason in reasons):
            log.warning("the broker %s does not let us have %s/#", self._broker.host, self._topic)
            return
        self.connected = True
        log.info("recordings are taken from %s, topic %s/#", self._broker.host, self._topic)

    def _disconnected(self, client: Client, _: Any, flags: Any, reason: Any, __: Any) -> None:
        self.connected = False
        if not self._ended.is_set():
            log.warning("no connection to the broker %s: %s", self._broker.host, reason)

    def _heard(self, client: Client, _: Any, message: MQTTMessage) -> None:
        """Take a message in, however long that takes, then acknowledge it."""
        while not self._ended.is_set():
            try:
                self._take(message)
            except Exception as error:
                is_known = isinstance(error, ShmError | OSError)
                log.warning("messages wait: %s", error, exc_info=not is_known)
                self._ended.wait(retry_pause_s(error, _RETRY_S))
            else:
                client.ack(message.mid, qos=1)
                return

    def _take(self, message: MQTTMessage) -> None:
        """Put a message where it is safe; what cannot be used must not come again."""
        level, _, given = message.topic.removeprefix(f"{self._topic}/").partition("/")
        payload = bytes(message.payload)
        if level == _STREAM and given:
            with suppress(BadInput):  # which is noted and logged
                workspace, _ = self._description.now()
                take_chunks(workspace, self._opened(), given, [payload], utc_now())
            return
        with incoming(self._workspace.spool, len(payload)) as file:
            file.write(payload)
            try:
                name = landing_name(given)
            except BadInput:
                suffix = _suffix(payload[:_HEAD_BYTES])
                name = landing_name(f"hanger-{level}-{file.sha256[:8]}{suffix}")
            is_again = message.dup or message.retain
            if is_again and find_by_checksum(self._opened(), file.sha256) is not None:
                return
            try:
                for setting in ("max_file_bytes", "mqtt_max_bytes"):
                    most = getattr(self._workspace.settings, setting)
                    refuse_oversize(file.size_bytes, most, setting=setting)
            except TooLarge as error:
                move_to_quarantine(
                    self._workspace, file.whole(), name, error, utc_now(), file.sha256
                )
                log.warning("%s is refused: %s %s", name, error.message, error.remedy)
                return
            hanger = int(level) if re.fullmatch(r"\d{1,9}", level) else level
            file.land(name, {"hanger": hanger})

    def _opened(self) -> Store:
        if self._store is None:
            self._store = self._workspace.store()
        return self._store


def _suffix(head: bytes) -> str:
    """Of a file without a name, by what it looks like."""
    if head.lstrip().startswith(b"{"):
        return MODES_SUFFIX
    return next((kind.suffixes[0] for kind in FORMATS if kind.recognises(head)), "")


def _bad_url(what: str) -> BadInput:
    return BadInput(
        f"the setting mqtt_url {what}.",
        remedy=f"Write mqtts://user@host:8883, and put the password into {PASSWORD_VARIABLE}.",
    )
