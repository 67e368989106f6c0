"""Recordings by MQTT, from a real broker: acknowledged once received, and never lost."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

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
        received(bridge)
        until(lambda: not spooled(bridge))
        time.sleep(0.5)  # they are acknowledged


def test_what_was_not_received_is_sent_again_and_stored_once(
    bridge: Workspace, broker: Broker
) -> None:
    with listening(bridge) as first:
        for number in range(5):
            broker.publish(f"{TOPIC}/hit{number}.csv", b"%d" % number)
        until(lambda: len(first.waiting) == 5)
    with listening(bridge) as second:
        until(lambda: len(second.waiting) == 5)
        assert len(spooled(bridge)) == 5
        assert received(bridge) == [Outcome.NEW] * 5
        until(lambda: not second.waiting)
    with listening(bridge):
        time.sleep(0.5)
        assert spooled(bridge) == []


def test_what_was_received_but_not_acknowledged_is_not_taken_twice(
    bridge: Workspace, broker: Broker
) -> None:
    with listening(bridge):
        broker.publish(f"{TOPIC}/hit.csv", b"again")
        until(lambda: spooled(bridge))
    assert received(bridge) == [Outcome.NEW]
    with listening(bridge) as second:
        time.sleep(0.5)
        assert (spooled(bridge), second.waiting) == ([], [])
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
            until(lambda: not listener.waiting)


def test_too_large_a_message_is_laid_in_the_quarantine_with_its_reason(
    bridge: Workspace, broker: Broker
) -> None:
    large = bridge.quarantine.folder / "large.csv"
    reason = bridge.quarantine.folder / "large.csv.reason.json"
    with listening(bridge) as listener:
        broker.publish(f"{TOPIC}/large.csv", bytes(10_001))
        until(large.exists)  # it comes after its reason
        assert "mqtt_max_bytes" in json.loads(reason.read_text())["remedy"]
        assert large.stat().st_size == 10_001
        assert (spooled(bridge), listener.waiting) == ([], [])
        time.sleep(0.3)
    reason.unlink()
    with listening(bridge):
        time.sleep(0.5)
    assert not reason.exists()  # it was acknowledged


@pytest.mark.slow
def test_a_store_that_is_out_holds_messages_up_and_loses_none(
    bridge: Workspace, broker: Broker, tmp_path: Path
) -> None:
    with listening(bridge) as listener:
        broker.publish(f"{TOPIC}/hit.csv", b"patience")
        until(lambda: listener.waiting)
        gone = tmp_path / "gone.db"
        bridge.database.rename(gone)
        (bridge.spool / "hit.csv").rename(tmp_path / "hit.csv")
        time.sleep(0.6)
        assert listener.waiting  # out of the spool, but who knows whether the store has it
        gone.rename(bridge.database)
        (tmp_path / "hit.csv").rename(bridge.spool / "hit.csv")
        assert received(bridge) == [Outcome.NEW]
        until(lambda: not listener.waiting)


@pytest.mark.parametrize(
    "url", ["mqtt://a:secret@b", "http://b", "b:1883", "mqtt://b:port", "mqtt://b/path"]
)
def test_a_wrong_address_is_refused_without_telling_a_password(url: str) -> None:
    with pytest.raises(BadInput) as refused:
        Address.of(url, {})
    assert "secret" not in str(refused.value)
    assert "SHM_MQTT_PASSWORD" in str(refused.value)
