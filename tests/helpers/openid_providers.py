"""A small provider of OpenID Connect on this machine; it signs with a key of its own.

It shares no code with what checks its tokens but the arithmetic of `cryptography`.
"""

from __future__ import annotations

import base64
import hashlib
import hmac
import json
import secrets
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qsl, urlsplit

from cryptography.hazmat.primitives.asymmetric import padding, rsa
from cryptography.hazmat.primitives.hashes import SHA256

CLIENT, SECRET = "shm-bridge", "a secret of both"


@cache
def key(name: str) -> rsa.RSAPrivateKey:
    """One for each name: the provider's, and those of others."""
    return rsa.generate_private_key(65537, 2048)


def b64(data: bytes) -> str:
    return base64.urlsafe_b64encode(data).rstrip(b"=").decode()


@dataclass
class Provider:
    """What it says; a test changes it. `claims` go over those of a token that is right."""

    issuer: str = ""
    claims: dict[str, Any] = field(default_factory=dict)
    document: dict[str, Any] = field(default_factory=dict)
    userinfo: dict[str, Any] = field(default_factory=dict)
    algorithm: str = "RS256"
    signs_with: str = "its own"
    begun: dict[str, dict[str, str]] = field(default_factory=dict)

    def confirm(self, address: str) -> dict[str, str]:
        """A person signs in at the address that they were sent to: what they come back with."""
        asked = dict(parse_qsl(urlsplit(address).query))
        assert address.startswith(f"{self.issuer}/authorize?")
        assert (asked["response_type"], asked["code_challenge_method"]) == ("code", "S256")
        code = secrets.token_urlsafe()
        self.begun[code] = asked
        return {"code": code, "state": asked["state"]}

    def answer(self, path: str, told: dict[str, str], header: str) -> tuple[int, dict[str, Any]]:
        at = {name: f"{self.issuer}/{name}" for name in ("authorize", "token", "keys", "userinfo")}
        if path == "/.well-known/openid-configuration":
            return 200, {
                "issuer": self.issuer,
                "authorization_endpoint": at["authorize"],
                "token_endpoint": at["token"],
                "jwks_uri": at["keys"],
                "userinfo_endpoint": at["userinfo"],
                # What it would take is not for it to say.
                "id_token_signing_alg_values_supported": ["RS256", "HS256", "none"],
                **self.document,
            }
        if path == "/keys":
            numbers = key("its own").public_key().public_numbers()
            n, e = (b64(v.to_bytes((v.bit_length() + 7) // 8)) for v in (numbers.n, numbers.e))
            return 200, {"keys": [{"kty": "RSA", "kid": "1", "use": "sig", "n": n, "e": e}]}
        if path == "/userinfo":
            return (200, self.userinfo) if header == "Bearer opaque" else (401, {})
        if path == "/token":
            return self._exchange(told, header)
        return 404, {}

    def _exchange(self, told: dict[str, str], header: str) -> tuple[int, dict[str, Any]]:
        known = base64.b64encode(f"{CLIENT}:{SECRET}".encode()).decode()
        if header != f"Basic {known}":
            return 401, {"error": "invalid_client"}
        asked = self.begun.pop(told["code"], None)
        challenge = b64(hashlib.sha256(told["code_verifier"].encode()).digest())
        if (
            asked is None
            or asked["code_challenge"] != challenge
            or asked["redirect_uri"] != told["redirect_uri"]
        ):
            return 400, {"error": "invalid_grant"}
        token = {"access_token": "opaque", "token_type": "Bearer", "expires_in": 600}
        return 200, {**token, "id_token": self._id_token(asked["nonce"])}

    def _id_token(self, nonce: str) -> str:
        now = int(time.time())
        right = {
            "iss": self.issuer,
            "sub": "248289761001",
            "aud": CLIENT,
            "iat": now,
            "exp": now + 300,
            "nonce": nonce,
            "email": "ann@example.org",
            "email_verified": True,
        }
        claims = {k: v for k, v in {**right, **self.claims}.items() if v is not None}
        head = {"alg": self.algorithm, "kid": "1"}
        signed = ".".join(b64(json.dumps(part).encode()) for part in (head, claims))
        return f"{signed}.{b64(self._signature(signed.encode()))}"

    def _signature(self, signed: bytes) -> bytes:
        if self.algorithm == "none":
            return b""
        if self.algorithm == "HS256":
            return hmac.digest(SECRET.encode(), signed, "sha256")
        return key(self.signs_with).sign(signed, padding.PKCS1v15(), SHA256())


class _Handler(BaseHTTPRequestHandler):
    provider: Provider

    def do_GET(self) -> None:
        self._answer({})

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["Content-Length"])).decode()
        self._answer(dict(parse_qsl(body)))

    def _answer(self, told: dict[str, str]) -> None:
        header = self.headers.get("Authorization", "")
        status, document = self.provider.answer(urlsplit(self.path).path, told, header)
        body = json.dumps(document).encode()
        self.send_response(status)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:
        pass  # the tests' output is no access log


@contextmanager
def running() -> Iterator[Provider]:
    """A provider that answers until the end of the block."""
    provider = Provider()
    handler = type("Handler", (_Handler,), {"provider": provider})
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        provider.issuer = f"http://127.0.0.1:{server.server_port}"
        thread = threading.Thread(target=server.serve_forever, args=(0.05,))
        thread.start()
        try:
            yield provider
        finally:
            server.shutdown()
            thread.join()
