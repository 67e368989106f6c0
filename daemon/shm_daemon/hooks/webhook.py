"""A hook that is an address: the alert is posted to it as JSON, signed with a shared secret.

The signature is over the time and the body, so that who listens can refuse what is forged, and what
is old. It is made as most services make theirs: HMAC with SHA-256 (RFC 2104, Krawczyk 1997).
"""

from __future__ import annotations

import hashlib
import hmac
import time
from http import HTTPStatus

from shm.bridge import WebhookHook
from shm.documents import dump
from shm.pipeline import DeliveryRefused
from shm.values import Alert
from shm_daemon.hooks.contract import (
    SHOWN_CHARACTERS,
    DeliveryContext,
    HookFailed,
    one_line,
    read_secret,
)
from shm_daemon.http_client import Answer, HttpClient, NoAnswer

_WORTH_ANOTHER_TRY = (
    HTTPStatus.REQUEST_TIMEOUT,
    HTTPStatus.TOO_EARLY,
    HTTPStatus.TOO_MANY_REQUESTS,
)
_LOOK = "See that its server runs, then try `shm alerts test`."


class WebhookDeliverer:
    """Posts each alert; an answer of 200 to 299 says that it is delivered."""

    def __init__(self, surroundings: DeliveryContext):
        self._surroundings, self._client = surroundings, HttpClient()

    def __call__(self, hook: WebhookHook, alert: Alert) -> str:
        """Post the alert; raises HookFailed, or DeliveryRefused where the server wants none."""
        body = dump(self._surroundings.document(alert)).encode()
        headers = _headers(alert, body, self._secret(hook), int(time.time()))
        timeout_s = self._surroundings.timeout_s
        try:
            answer = self._client.send(
                "POST", hook.url, timeout_s, SHOWN_CHARACTERS, data=body, headers=headers
            )
        except NoAnswer as error:
            raise _failure(hook, error, is_closed=self._client.closed) from None
        return _judged(answer)

    def ready(self, hook: WebhookHook) -> str:
        """The machine that is told; raises HookFailed where the secret is missing."""
        self._secret(hook)
        return hook.host

    def close(self) -> None:
        self._client.close()

    def _secret(self, hook: WebhookHook) -> bytes:
        surroundings = self._surroundings
        if hook.secret_env:
            secret = surroundings.environment.get(hook.secret_env, "")
            where = f"the variable {hook.secret_env} of the environment"
        else:
            secret = read_secret(surroundings.folder, hook.secret_file, HookFailed)
            where = hook.secret_file
        if not secret:
            raise HookFailed(
                f"{where} holds no secret.", remedy="Put one there; see docs/alerts.md."
            )
        return secret.encode(errors="surrogateescape")


def _failure(hook: WebhookHook, error: NoAnswer, *, is_closed: bool) -> HookFailed:
    if is_closed:
        return HookFailed("broken off: the daemon is ending.")
    if error.is_untrusted:
        return HookFailed(
            f"{hook.host} cannot show that it is who it says ({error.reason}).",
            remedy="Have its certificate renewed.",
        )
    if error.is_late:
        return HookFailed(
            error.reason.replace("answer", f"answer of {hook.host}") + ".", remedy=_LOOK
        )
    return HookFailed(f"{hook.host} cannot be reached ({error.reason}).", remedy=_LOOK)


def signature(secret: bytes, timestamp: str, body: bytes) -> str:
    """Return what stands in X-Shm-Signature: who listens makes it again and compares."""
    made = hmac.new(secret, timestamp.encode() + b"." + body, hashlib.sha256)
    return f"sha256={made.hexdigest()}"


def _headers(alert: Alert, body: bytes, secret: bytes, unix_s: int) -> dict[str, str]:
    return {
        "Content-Type": "application/json",
        "User-Agent": "shm",
        "Idempotency-Key": alert.key.encode("ascii", "backslashreplace").decode(),
        "X-Shm-Timestamp": str(unix_s),
        "X-Shm-Signature": signature(secret, str(unix_s), body),
    }


def _judged(answer: Answer) -> str:
    """Return what the server answered, if it took the alert.

    Raises HookFailed or DeliveryRefused.
    """
    status = answer.status
    if 200 <= status < 300:
        return f"{status} {answer.reason}".strip()
    words = one_line(answer.body.decode(errors="replace"))
    message = f"answered {status}: {words or answer.reason or 'no message'}"
    if 300 <= status < 400:
        raise HookFailed(message, remedy="Write the address that it sends to; it is not followed.")
    if 400 <= status < 500 and status not in _WORTH_ANOTHER_TRY:
        raise DeliveryRefused(message, remedy="Correct its address or its secret.")
    raise HookFailed(message, remedy=_LOOK)
