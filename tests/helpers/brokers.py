"""A real MQTT broker of a test's own, in a process of its own, so that it can be killed.

Mosquitto where it is installed, else amqtt, which is mended first: against the protocol
[MQTT-4.4.0-1] it forgets what was not acknowledged within five seconds or before the connection
broke.
"""

from __future__ import annotations

import asyncio
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import paho.mqtt.client as paho
from paho.mqtt.enums import CallbackAPIVersion

ROOT = Path(__file__).resolve().parents[2]


@dataclass
class Broker:
    """A broker on a port that it keeps over its restarts."""

    port: int
    process: subprocess.Popen[bytes] | None = None

    @property
    def url(self) -> str:
        return f"mqtt://shm@127.0.0.1:{self.port}"  # amqtt keeps nothing for the nameless

    def begin(self) -> None:
        mosquitto = shutil.which("mosquitto")
        here = [sys.executable, "-m", "tests.helpers.brokers", str(self.port)]
        command = [mosquitto, "-p", str(self.port)] if mosquitto else here
        self.process = subprocess.Popen(command, cwd=ROOT, stderr=subprocess.DEVNULL)
        end = time.monotonic() + 120
        while True:
            try:
                socket.create_connection(("127.0.0.1", self.port), 1).close()
                return
            except OSError:
                if time.monotonic() > end:
                    raise
                time.sleep(0.02)

    def kill(self) -> None:
        if self.process is not None:
            self.process.kill()
            self.process.wait()

    def publish(self, topic: str, payload: bytes) -> None:
        """Publishes and waits until the broker has it."""
        client = paho.Client(CallbackAPIVersion.VERSION2)
        client.username_pw_set("logger")
        client.connect("127.0.0.1", self.port)
        client.loop_start()
        client.publish(topic, payload, qos=1).wait_for_publish(20)
        client.disconnect()
        client.loop_stop()


@contextmanager
def a_broker() -> Iterator[Broker]:
    """A broker until the end of the block."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        broker = Broker(free.getsockname()[1])
    broker.begin()
    try:
        yield broker
    finally:
        broker.kill()


async def _serve(port: int) -> None:
    from amqtt.broker import Broker as Server
    from amqtt.mqtt.protocol.handler import ProtocolHandler

    ProtocolHandler._handle_qos1_message_flow = _until_acknowledged(
        ProtocolHandler._handle_qos1_message_flow
    )
    plugins = {"amqtt.plugins.authentication.AnonymousAuthPlugin": {"allow_anonymous": False}}
    listeners = {"default": {"type": "tcp", "bind": f"127.0.0.1:{port}"}}
    await Server({"listeners": listeners, "plugins": plugins}).start()
    await asyncio.Event().wait()


def _until_acknowledged(once: Any) -> Any:
    """Keeps a message in its session until it is acknowledged, and sends it again till then."""

    async def flow(handler: Any, message: Any) -> None:
        session = handler.session
        try:
            await once(handler, message)
        finally:
            if message.puback_packet is None:
                session.inflight_out[message.packet_id] = message

    return flow


if __name__ == "__main__":
    asyncio.run(_serve(int(sys.argv[1])))
