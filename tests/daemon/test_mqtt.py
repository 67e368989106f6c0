"""Recordings by MQTT, from a real broker: acknowledged once in the spool, and never lost."""

from __future__ import annotations

import json
import time
import tracemalloc
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from paho.mqtt.client import Client

from shm.errors import BadInput
from shm.pipeline import utc_now
from shm.pipeline.intake import receive
from shm.store import Outcome, Workspace
from shm.store.journal import list_events
from shm_daemon.mqtt import Broker as Address
from shm_daemon.mqtt import Listener, messages
from shm_daemon.spool import scan
from tests.helpers.brokers import Broker, a_broker
from tests.helpers.waiting import until
from tests.helpers.workspaces import make_workspace

TOPIC = "shm/test-bridge/3"


@pytest.fixture
def broker() -> Iterator[Broker]:
    """Each test's own, since a broker keeps sessions and what was not acknowledged in them."""
    with a_broker() as broker:
        yield broker


@pytest.fixture
def bridge(tmp_path: Path, broker: Broker) -> Workspace:
    return a_bridge(tmp_path, broker)


def a_bridge(folder: Path, broker: Broker, name: str = "bridge") -> Workspace:
    settings = {"mqtt_url": broker.url, "mqtt_max_bytes": 10_000}
    return make_workspace(folder / name, settings=settings)


def spooled(workspace: Workspace) -> list[str]:
    return sorted(path.name for path in scan(workspace.spool))


def received(workspace: Workspace) -> list[Outcome]:
    """Work on the spool as the daemon does."""
    with workspace.store() as store:
        return [
            receive(path, workspace, store, utc_now()).outcome for path in scan(workspace.spool)
        ]


@contextmanager
def listening(workspace: Workspace, *, at_once: bool = True) -> Iterator[Listener]:
    """End as if killed: what is not acknowledged by then never is on this connection."""
    listener = Listener(workspace, Address.of(workspace.settings.mqtt_url, {}))
    listener.begin()
    try:
        until(lambda: listener.connected or not at_once)
        yield listener
    finally:
        listener.end()


def test_a_message_lands_with_its_hanger_and_its_name(bridge: Workspace, broker: Broker) -> None:
    with messages(bridge):
        time.sleep(0.5)
        broker.publish(f"{TOPIC}/hit.csv", b"force,acc_1\n")
        until(lambda: spooled(bridge) == ["hit.csv"])
        assert (bridge.spool / "hit.csv").read_bytes() == b"force,acc_1\n"
        assert (bridge.spool / "hit.toml").read_text() == "hanger = 3\n"
        broker.publish(TOPIC, b'{"schema": "shm.modes/1"}')
        broker.publish("shm/test-bridge/three", b"force,acc_1\n1,2\n")
        until(lambda: len(spooled(bridge)) == 3)
        assert [name.rpartition("-")[0] for name in spooled(bridge)[:2]] == [
            "hanger-3",
            "hanger-three",
        ]
        assert [name.partition(".")[2] for name in spooled(bridge)[:2]] == ["modes.json", "csv"]
        assert len(received(bridge)) == 3


def test_unacknowledged_message_taken_once(
    bridge: Workspace, broker: Broker, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Killed between the spool and the broker: before the store has the file, and after."""
    monkeypatch.setattr(Client, "ack", lambda *_args, **_named: None)
    names = [f"hit{number}.csv" for number in range(5)]
    with listening(bridge):
        for number, name in enumerate(names):
            broker.publish(f"{TOPIC}/{name}", b"%d" % number)
        until(lambda: spooled(bridge) == names)
    with listening(bridge):
        time.sleep(0.5)
        assert spooled(bridge) == names
        assert received(bridge) == [Outcome.NEW] * 5
    monkeypatch.undo()
    for _ in range(2):
        with listening(bridge):
            time.sleep(0.5)
            assert spooled(bridge) == []
    with bridge.store() as store:
        assert list_events(store) == ()


@pytest.mark.slow
def test_a_broker_that_is_killed_is_found_again(tmp_path: Path) -> None:
    with a_broker() as broker:
        workspace = a_bridge(tmp_path, broker)
        broker.kill()
        with listening(workspace, at_once=False) as listener:  # no broker yet: nobody is stopped
            broker.begin()
            until(lambda: listener.connected)
            broker.publish(f"{TOPIC}/before.csv", b"before")
            until(lambda: spooled(workspace) == ["before.csv"])
            broker.kill()
            until(lambda: not listener.connected)
            broker.begin()
            until(lambda: listener.connected)
            broker.publish(f"{TOPIC}/after.csv", b"after")
            until(lambda: spooled(workspace) == ["after.csv", "before.csv"])
            assert received(workspace) == [Outcome.NEW] * 2


def test_too_large_a_message_is_laid_in_the_quarantine_with_its_reason(
    bridge: Workspace, broker: Broker
) -> None:
    large = bridge.quarantine.folder / "large.csv"
    reason = bridge.quarantine.folder / "large.csv.reason.json"
    with listening(bridge):
        broker.publish(f"{TOPIC}/large.csv", bytes(10_001))
        until(large.exists)  # it comes after its reason
        assert "mqtt_max_bytes" in json.loads(reason.read_text())["remedy"]
        assert large.stat().st_size == 10_001
        assert spooled(bridge) == []
        time.sleep(0.3)
    reason.unlink()
    with listening(bridge):
        time.sleep(0.5)
    assert not reason.exists()  # it was acknowledged


@pytest.mark.parametrize(
    "url", ["mqtt://a:secret@b", "http://b", "b:1883", "mqtt://b:port", "mqtt://b/path"]
)
def test_a_wrong_address_is_refused_without_telling_a_password(url: str) -> None:
    with pytest.raises(BadInput) as refused:
        Address.of(url, {})
    assert "secret" not in str(refused.value)
    assert "SHM_MQTT_PASSWORD" in str(refused.value)


@pytest.mark.slow
def test_what_came_while_the_daemon_was_down_is_taken_in(bridge: Workspace, broker: Broker) -> None:
    with listening(bridge):
        pass
    broker.publish(f"{TOPIC}/meanwhile.csv", b"meanwhile")
    with listening(bridge):
        until(lambda: spooled(bridge))
        assert received(bridge) == [Outcome.NEW]


def test_flood_waits_at_broker(tmp_path: Path, broker: Broker) -> None:
    settings = {"mqtt_url": broker.url, "mqtt_max_bytes": 3_500_000}
    workspace = make_workspace(tmp_path / "bridge", settings=settings)
    names = sorted(f"hit{number:02d}.csv" for number in range(9))
    with listening(workspace):
        away = workspace.spool.rename(tmp_path / "away")
        tracemalloc.start()
        try:
            for number, name in enumerate(names):
                broker.publish(f"{TOPIC}/{name}", b"%02d" % number * 500_000)
            time.sleep(1.0)  # all that will come have come
            held_bytes = tracemalloc.get_traced_memory()[0]
        finally:
            tracemalloc.stop()
        away.rename(workspace.spool)
        outcomes: list[Outcome] = []
        until(lambda: outcomes.extend(received(workspace)) or len(outcomes) >= len(names))
    assert held_bytes < 6_000_000  # 9 MB were sent
    assert outcomes == [Outcome.NEW] * len(names)
    with listening(workspace):
        time.sleep(0.5)
        assert spooled(workspace) == []  # all are acknowledged
