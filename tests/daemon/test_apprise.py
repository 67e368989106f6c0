"""Hooks by apprise: sent in a process of its own, only to services that carry messages."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from shm.bridge import AppriseHook
from shm.bridge.hooks import APPRISE_SCHEMES
from shm_daemon import HookFailed, HookNotifier
from shm_daemon.hooks import apprise as apprise_hook
from tests.helpers.listeners import Answer, Listener, a_listener, a_silent_listener
from tests.helpers.nouns import an_alert

apprise = pytest.importorskip("apprise")


@pytest.fixture
def listener() -> Iterator[Listener]:
    with a_listener() as listener:
        yield listener


def address(url: str, user: str = "") -> str:
    return url.replace("http://", f"json://{user}")


def a_notifier(tmp_path: Path, timeout_s: float = 20.0) -> HookNotifier:
    return HookNotifier(tmp_path, timeout_s, {})


def failure(tmp_path: Path, *addresses: str, timeout_s: float = 20.0) -> str:
    with pytest.raises(HookFailed) as caught:
        a_notifier(tmp_path, timeout_s)(AppriseHook("people", addresses), an_alert())
    assert caught.value.remedy
    return caught.value.message


def test_people_are_told_what_happened_and_when(tmp_path: Path, listener: Listener) -> None:
    hook = AppriseHook("people", (address(listener.url),))
    alert = an_alert()
    marked = replace(alert, message=f"{alert.message} See `shm drift`.")
    assert a_notifier(tmp_path)(hook, marked) == "taken by json"
    told = json.loads(listener.told[0].body)
    assert told["title"] == "shm: hanger 3"
    assert "See shm drift." in told["message"]
    assert "Hanger 3: tension moved." in told["message"]
    assert "Test t2 of 2026-05-01 12:00 UTC." in told["message"]
    assert "Key: hanger-3:tension-down" in told["message"]
    assert told["type"] == "warning"


def test_addresses_may_stand_in_a_file_with_remarks(tmp_path: Path, listener: Listener) -> None:
    one, two = address(listener.url), address(listener.url.replace("alerts", "others"))
    (tmp_path / "people.txt").write_text(f"# the crew\n{one}\n\n  {two}\n")
    hook = AppriseHook("people", address_file="people.txt")
    assert a_notifier(tmp_path)(hook, an_alert()) == "taken by json, json"
    assert [told.path for told in listener.told] == ["/alerts", "/others"]


def test_a_service_that_does_not_take_the_alert_is_named_without_its_password(
    tmp_path: Path, listener: Listener
) -> None:
    def answer(told: object) -> Answer:
        return Answer(401) if "token" in getattr(told, "path", "") else Answer()

    listener.answer = answer
    bad = address(listener.url, "me:hunt%40er2@").replace("alerts", "token-of-mine")
    message = failure(tmp_path, address(listener.url), bad)
    assert message.startswith("exit code 1: 1 of 2 (json): ")
    assert "401" in message
    for secret in ("hunt", "token-of-mine", "me:"):
        assert secret not in message


def test_a_service_that_hangs_is_ended(tmp_path: Path) -> None:
    with a_silent_listener(b"HTTP/1.1 200 OK\r\n" + b"X-A: 1\r\n" * 500) as url:
        assert "ended after 2 s" in failure(tmp_path, address(url), timeout_s=2.0)


def test_without_the_library_it_is_said_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(apprise_hook, "find_spec", lambda name: None)
    with pytest.raises(HookFailed, match=r"not installed.*pip install 'shm\[alerts\]'"):
        a_notifier(tmp_path)(AppriseHook("people", ("json://a.example",)), an_alert())


@pytest.mark.filterwarnings("ignore:'imghdr' is deprecated")
def test_every_service_that_is_allowed_exists_and_goes_over_a_network() -> None:
    known: dict[str, str] = {}
    for service in apprise.Apprise().details()["schemas"]:
        for scheme in (*(service["protocols"] or ()), *(service["secure_protocols"] or ())):
            known[scheme] = str(service["service_name"])
    assert known.keys() >= APPRISE_SCHEMES
    names = {known[scheme] for scheme in APPRISE_SCHEMES}
    assert not names & {"Syslog", "Remote Syslog", "DBus Notification", "Kodi/XBMC", "IRC"}
