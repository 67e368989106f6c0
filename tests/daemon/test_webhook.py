"""Webhooks: signed posts, what is tried again and what is not, servers that hang, no secrets."""

from __future__ import annotations

import hashlib
import hmac
import json
import socket
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from shm.bridge import WebhookHook
from shm.pipeline import DeliveryRefused
from shm_daemon import HookFailed, HookNotifier
from tests.helpers.listeners import Answer, Listener, a_listener, a_silent_listener
from tests.helpers.nouns import an_alert

SECRET = "not for everyone"


@pytest.fixture
def listener() -> Iterator[Listener]:
    with a_listener() as listener:
        yield listener


def a_hook(url: str) -> WebhookHook:
    return WebhookHook("ops", url, secret_env="OPS_SECRET")


def a_notifier(tmp_path: Path, timeout_s: float = 10.0) -> HookNotifier:
    return HookNotifier(tmp_path, timeout_s, {"OPS_SECRET": SECRET})


def failure(tmp_path: Path, url: str, timeout_s: float = 10.0) -> str:
    with pytest.raises(HookFailed) as caught:
        a_notifier(tmp_path, timeout_s)(a_hook(url), an_alert())
    assert caught.value.remedy
    return caught.value.message


def test_an_alert_is_posted_with_its_key(tmp_path: Path, listener: Listener) -> None:
    assert a_notifier(tmp_path)(a_hook(listener.url), an_alert()) == "200 OK"
    (told,) = listener.told
    assert told.headers["Content-Type"] == "application/json"
    assert told.headers["Idempotency-Key"] == "hanger-3:tension-down"
    assert json.loads(told.body)["key"] == "hanger-3:tension-down"
    assert json.loads(told.body)["schema"] == "shm.alert/1"


def test_the_signature_is_over_the_time_and_the_body(tmp_path: Path, listener: Listener) -> None:
    before = int(time.time())
    a_notifier(tmp_path)(a_hook(listener.url), an_alert())
    (told,) = listener.told
    timestamp = told.headers["X-Shm-Timestamp"]
    assert before <= int(timestamp) <= time.time()
    signed = timestamp.encode() + b"." + told.body
    expected = hmac.new(SECRET.encode(), signed, hashlib.sha256).hexdigest()
    assert told.headers["X-Shm-Signature"] == f"sha256={expected}"


def test_the_secret_may_stand_in_a_file_and_may_be_changed(
    tmp_path: Path, listener: Listener
) -> None:
    notifier, hook = a_notifier(tmp_path), WebhookHook("ops", listener.url, secret_file="s.txt")
    signatures = []
    for secret in ("one\n", "two\n", "one"):
        (tmp_path / "s.txt").write_text(secret)
        notifier(hook, replace(an_alert()))
        told = listener.told[-1]
        signed = told.headers["X-Shm-Timestamp"].encode() + b"." + told.body
        expected = hmac.new(secret.strip().encode(), signed, hashlib.sha256).hexdigest()
        assert told.headers["X-Shm-Signature"] == f"sha256={expected}"
        signatures.append(expected)
    assert signatures[0] != signatures[1]


@pytest.mark.parametrize("where", [{"secret_file": "none.txt"}, {"secret_env": "NONE"}])
def test_without_its_secret_nothing_is_sent(
    tmp_path: Path, listener: Listener, where: dict[str, str]
) -> None:
    with pytest.raises(HookFailed, match=r"none\.txt|NONE"):
        a_notifier(tmp_path)(WebhookHook("ops", listener.url, **where), an_alert())
    assert listener.told == []


@pytest.mark.parametrize("status", [429, 503, 302])
def test_what_may_pass_is_tried_again(tmp_path: Path, listener: Listener, status: int) -> None:
    listener.answer = lambda told: Answer(status, b"busy\x1b[31m\nnow")
    assert failure(tmp_path, listener.url) == f"answered {status}: busy [31m now"


@pytest.mark.parametrize("status", [401, 410])
def test_a_refusal_is_final_and_told_in_the_servers_words(
    tmp_path: Path, listener: Listener, status: int
) -> None:
    listener.answer = lambda told: Answer(status, b"no such topic" + b"." * 10_000)
    with pytest.raises(DeliveryRefused, match=f"answered {status}: no such topic") as caught:
        a_notifier(tmp_path)(a_hook(listener.url), an_alert())
    assert len(caught.value.message) < 600


@pytest.mark.parametrize("status", [302, 307])
def test_an_alert_does_not_go_elsewhere(tmp_path: Path, listener: Listener, status: int) -> None:
    with a_listener() as elsewhere:
        listener.answer = lambda told: Answer(status, headers=(("Location", elsewhere.url),))
        assert f"answered {status}" in failure(tmp_path, listener.url)
        assert elsewhere.told == []
    assert len(listener.told) == 1


def test_a_server_that_is_not_there_is_named(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    message = failure(tmp_path, f"http://127.0.0.1:{port}/token-of-mine")
    assert message == "127.0.0.1 cannot be reached (Connection refused)."


@pytest.mark.parametrize("drip", [b"", b"HTTP/1.1 200 OK\r\n" + b"X-A: 1\r\n" * 500])
def test_a_server_that_hangs_or_answers_drop_by_drop_is_given_up(
    tmp_path: Path, drip: bytes
) -> None:
    with a_silent_listener(drip) as url:
        assert failure(tmp_path, url, 1.0) == "no answer of 127.0.0.1 within 1 s."


def test_what_hangs_while_it_encrypts_is_given_up_too(tmp_path: Path) -> None:
    with a_silent_listener(b"\x16\x03\x03\x40\x00" + b"\x02" * 100) as url:
        message = failure(tmp_path, url.replace("http:", "https:"), 1.0)
    assert message == "no answer of 127.0.0.1 within 1 s."


def test_closing_breaks_off_a_request_under_way_and_begins_no_more(tmp_path: Path) -> None:
    notifier, failures = a_notifier(tmp_path, 60.0), []

    def deliver() -> None:
        try:
            notifier(a_hook(url), an_alert())
        except HookFailed as error:
            failures.append(error.message)

    with a_silent_listener() as url:
        thread = threading.Thread(target=deliver)
        thread.start()
        time.sleep(0.5)
        assert thread.is_alive()
        notifier.close()
        thread.join(120)
        assert not thread.is_alive()
        deliver()
    assert failures == ["broken off: the daemon is ending."] * 2


def test_what_goes_wrong_shows_neither_the_secret_nor_the_address(
    tmp_path: Path, listener: Listener, caplog: pytest.LogCaptureFixture
) -> None:
    refused = listener.url.replace("/alerts", "/token-of-mine")
    listener.answer = lambda told: Answer(503)
    for url in (
        refused,
        "http://127.0.0.1:1/token-of-mine",
        "http://nowhere.invalid/token-of-mine",
    ):
        message = failure(tmp_path, url, 5.0)
        assert "token-of-mine" not in message
        assert SECRET not in message
    caplog_text = "".join(r.getMessage() for r in caplog.records if r.levelname != "DEBUG")
    assert "token-of-mine" not in caplog_text


def test_a_password_of_the_users_own_is_not_sent(
    tmp_path: Path, listener: Listener, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "netrc").write_text("machine 127.0.0.1 login me password hunter2\n")
    (tmp_path / "netrc").chmod(0o600)
    monkeypatch.setenv("NETRC", str(tmp_path / "netrc"))
    a_notifier(tmp_path)(a_hook(listener.url), an_alert())
    assert "Authorization" not in listener.told[0].headers
