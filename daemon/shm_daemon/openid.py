"""An OpenID Connect provider: where people are sent to, and whom it says that they are.

The authorization code flow with PKCE (RFC 7636). Signature and claims are checked by authlib and
its joserfc; needs `shm[sso]`.
"""

from __future__ import annotations

import secrets
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import requests
from authlib.integrations.requests_client import OAuth2Session, OAuthError
from authlib.oidc.core import CodeIDToken
from joserfc import jwt
from joserfc.errors import ClaimError, JoseError
from joserfc.jwk import KeySet
from joserfc.jws import JWSRegistry

from shm.bridge.description import EMAIL, SingleSignOn, is_safe
from shm.errors import ShmError
from shm_daemon.hooks.contract import read_secret
from shm_daemon.http_client import reason_of

_ALGORITHMS = ("RS256", "RS384", "RS512", "PS256", "PS384", "PS512", "ES256", "ES384", "ES512",
               "EdDSA")  # fmt: skip
"""Signatures by a key that the provider alone has: neither `none` nor one that we could make."""
_ENDPOINTS = ("authorization_endpoint", "token_endpoint", "jwks_uri")
_TIMEOUT_S = 5.0  # judgement: a person waits, and holds a place of the pages meanwhile
_LEEWAY_S = 60  # judgement: clocks that differ by more are to be set; `shm doctor` says as much
_CACHE_S = 300.0  # judgement: a provider that has moved is followed within five minutes
_AT_ONCE = 4  # technical: a provider that hangs holds few of the 24 places of the pages
_CLOCK = "Set this computer's clock, or have the provider's set."
_OTHERWISE = "Sign in with a password meanwhile; `shm doctor` tells whether it is back."
_DESCRIBE = "Compare [single_sign_on] in bridge.toml with what the provider states."


@dataclass(frozen=True)
class Begun:
    """A sign-in on its way: where the person is sent to, and what only we and the browser know."""

    url: str
    state: str
    nonce: str
    verifier: str
    back: str


class Provider:
    """One provider as `bridge.toml` describes it. May be used from many threads."""

    def __init__(self, described: SingleSignOn):
        self.described = described
        self._places = threading.BoundedSemaphore(_AT_ONCE)
        self._read: tuple[float, Mapping[str, Any]] | None = None

    def discover(self) -> Mapping[str, Any]:
        """Return the provider's metadata (OpenID Connect Discovery 1.0, 4); raises ShmError."""
        now = time.monotonic()
        if self._read is None or now - self._read[0] > _CACHE_S:
            address = f"{self.described.issuer.rstrip('/')}/.well-known/openid-configuration"
            with self._asking(), _session(self.described) as session:
                document = _document(session.get(address, withhold_token=True))
            self._refuse_foreign(document)
            self._read = now, document
        return self._read[1]

    def begin(self, back: str) -> Begun:
        """Return where to send a person who is to come back to `back`; raises ShmError."""
        document = self.discover()
        state, nonce, verifier = (secrets.token_urlsafe(48) for _ in range(3))
        with _session(self.described, document, back) as session:
            url, _ = session.create_authorization_url(
                document["authorization_endpoint"], state, code_verifier=verifier, nonce=nonce
            )
        return Begun(url, state, nonce, verifier, back)

    def name_of(self, begun: Begun, code: str) -> str:
        """The name of the user who has come back with a code; raises ShmError."""
        document, described = self.discover(), self.described
        with self._asking(), _session(described, document, begun.back) as session:
            endpoint = document["token_endpoint"]
            token = session.fetch_token(endpoint, code=code, code_verifier=begun.verifier)
            keys = _document(session.get(document["jwks_uri"], withhold_token=True))
            claims = _claims(described, token, keys, begun.nonce)
            if described.user_claim not in claims and "userinfo_endpoint" in document:
                userinfo = _document(session.get(document["userinfo_endpoint"]))
                # OpenID Connect Core 1.0, 5.3.2: else it may be of somebody else.
                claims = userinfo if userinfo.get("sub") == claims["sub"] else claims
        return _name_in(claims, described)

    def _refuse_foreign(self, document: Mapping[str, Any]) -> None:
        """Raises ShmError where the document is of another provider, or sends us astray."""
        if document.get("issuer") != self.described.issuer:
            raise ShmError(
                f"{self.described.host} says that its issuer is {document.get('issuer')!r}, not "
                f"{self.described.issuer!r}.",
                remedy="Write issuer in [single_sign_on] of bridge.toml exactly so, if it is it.",
            )
        for name in _ENDPOINTS:
            if not is_safe(str(document.get(name, ""))):
                raise ShmError(
                    f"{self.described.host} states no encrypted {name}.", remedy=_DESCRIBE
                )

    @contextmanager
    def _asking(self) -> Iterator[None]:
        """Few at once; what goes wrong is told in our words. Raises ShmError."""
        host = self.described.host
        if not self._places.acquire(blocking=False):
            raise _passing(f"{host} is asked for many people at once.", "Try again in a minute.")
        try:
            yield
        except OAuthError as error:
            raise self._refused(error) from error
        except JoseError as error:
            is_of_time = isinstance(error, ClaimError) and error.claim in ("exp", "nbf", "iat")
            raise ShmError(
                f"{host} has sent proof that does not hold: {error.description or error.error}.",
                remedy=_CLOCK if is_of_time else f"Begin again. {_DESCRIBE}",
            ) from error
        except requests.ConnectionError as error:
            raise _passing(f"{host} cannot be reached: {reason_of(error)}.", _OTHERWISE) from error
        except requests.Timeout as error:
            raise _passing(f"{host} does not answer in {_TIMEOUT_S:g} s.", _OTHERWISE) from error
        except requests.HTTPError as error:
            status = error.response.status_code
            raise _passing(f"{host} answers with status {status}.", _OTHERWISE) from error
        except (requests.RequestException, ValueError, KeyError, TypeError) as error:
            text = f"{host} does not answer as OpenID Connect has it ({type(error).__name__})."
            raise _passing(text, _DESCRIBE) from error
        finally:
            self._places.release()

    def _refused(self, error: OAuthError) -> ShmError:
        """Of a code that we cannot exchange."""
        if error.error in ("invalid_client", "unauthorized_client"):
            return ShmError(
                f"{self.described.host} does not take client_id and secret of this bridge.",
                remedy="An engineer corrects client_id in [single_sign_on] of bridge.toml, or the "
                f"secret in {self.described.client_secret_file.name}.",
            )
        text = f"{self.described.host} does not confirm the sign-in: {error.error}."
        return ShmError(text, remedy="Begin again.")


def _session(
    described: SingleSignOn, document: Mapping[str, Any] | None = None, back: str = ""
) -> OAuth2Session:
    """Raises ShmError where the secret cannot be read."""
    file = described.client_secret_file
    secret = read_secret(file.parent, file.name, ShmError)
    # Discovery 1.0, 3: `client_secret_basic` where it is not said.
    known = (document or {}).get("token_endpoint_auth_methods_supported", ["client_secret_basic"])
    session = OAuth2Session(
        described.client_id,
        secret,
        token_endpoint_auth_method="client_secret_basic"
        if "client_secret_basic" in known
        else "client_secret_post",
        scope="openid email profile",
        redirect_uri=back,
        code_challenge_method="S256",
        default_timeout=_TIMEOUT_S,
    )
    session.max_redirects = 0  # who is asked is named by the document, and is asked encrypted
    return session


def _document(answer: requests.Response) -> dict[str, Any]:
    answer.raise_for_status()
    return dict(answer.json())


def _claims(
    described: SingleSignOn, token: Mapping[str, Any], keys: Any, nonce: str
) -> Mapping[str, Any]:
    """Return the claims of an ID token, all verified (OpenID Connect Core 1.0, 3.1.3.7)."""
    registry = JWSRegistry(algorithms=_ALGORITHMS, strict_check_header=False)
    read = jwt.decode(token["id_token"], KeySet.import_key_set(keys), registry=registry)
    claims = CodeIDToken(
        read.claims,
        read.header,
        {
            "iss": {"essential": True, "value": described.issuer},
            "aud": {"essential": True, "value": described.client_id},
        },
        {
            "nonce": nonce,
            "client_id": described.client_id,
            "access_token": token.get("access_token"),
        },
    )
    claims.validate(leeway=_LEEWAY_S)
    return dict(claims)


def _name_in(claims: Mapping[str, Any], described: SingleSignOn) -> str:
    claim, host = described.user_claim, described.host
    name = claims.get(claim)
    if not isinstance(name, str) or not name:
        raise ShmError(
            f"{host} does not say {claim} of you.",
            remedy=f"Have it send {claim}, or name another user_claim in [single_sign_on].",
        )
    if claim == EMAIL and claims.get("email_verified") not in (True, "true"):
        # Else anybody who may type an address into the provider is that person here.
        raise ShmError(
            f"{host} has not verified your address {name}.",
            remedy="Have it verify addresses, or name another user_claim in [single_sign_on].",
        )
    return name


def _passing(message: str, remedy: str) -> ShmError:
    return ShmError(message, remedy=remedy, retry_after_s=60.0)
