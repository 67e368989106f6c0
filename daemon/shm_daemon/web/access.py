"""Who may do what: tokens and their scopes.

A program sends its token in a header, a browser in the cookie that signing in gave it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated
from urllib.parse import urlsplit

from fastapi import Depends, Request
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer

from shm.pipeline import utc_now
from shm.store import Scope, StoredToken
from shm_daemon.web.address import caller_of
from shm_daemon.web.faults import Refused
from shm_daemon.web.site import Site

COOKIE = "shm_token"
"""Holds the token of a person who has signed in at `/sign-in`."""
_bearer = HTTPBearer(
    auto_error=False,
    description="`shm token create NAME --scope read|write` makes one. Reading from the machine "
    "itself needs none while the interface listens there only. A browser that has signed in sends "
    "a cookie instead.",
)
_FORWARDED = ("forwarded", "x-forwarded-for", "x-forwarded-host", "x-real-ip")


@dataclass(frozen=True)
class Visitor:
    """Who asks: the name of the token, empty for this machine without one."""

    name: str
    may_write: bool = False


def site_of(request: Request) -> Site:
    """The site that the app serves."""
    site = request.app.state.site
    assert isinstance(site, Site)
    return site


AtSite = Annotated[Site, Depends(site_of)]
Credentials = Annotated[HTTPAuthorizationCredentials | None, Depends(_bearer)]


def reading(request: Request, site: AtSite, credentials: Credentials) -> Visitor:
    """Lets in who may read: this machine where only it can come in, else a token.

    `frame.page` shows who it is.
    """
    if credentials is not None:
        found = _visitor(request, site, credentials.credentials, Scope.READ)
    elif _is_at_home(request, site):
        found = _at_home(request, site)
    else:
        found = _visitor(request, site, _cookie(request, "Reading needs a token here."), Scope.READ)
    request.state.visitor = found
    return found


def writing(request: Request, site: AtSite, credentials: Credentials) -> Visitor:
    """Lets in who may write: only with a token, from wherever."""
    if credentials is not None:
        return _visitor(request, site, credentials.credentials, Scope.WRITE)
    token = _cookie(request, "Writing needs a token.")
    refuse_foreign(request)
    return _visitor(request, site, token, Scope.WRITE)


Reader = Annotated[Visitor, Depends(reading)]
Writer = Annotated[Visitor, Depends(writing)]


def refuse_foreign(request: Request) -> None:
    """Raises Refused where a page of somebody else has a browser send this.

    Browsers name the page's origin with whatever changes something; SameSite alone lets pages of
    other ports of this machine through.
    """
    origin, host = request.headers.get("origin", ""), request.headers.get("host", "")
    if not origin or urlsplit(origin).netloc.lower() != host.lower():
        raise Refused(403, "This was sent by a page of another site.", "Send it from our page.")


def token_in_force(request: Request, site: Site, secret: str) -> StoredToken:
    """The token of this secret; raises Refused where it is wrong or revoked, or where too many of
    those came from the same address.
    """
    forwarded = request.headers.get("x-forwarded-for", "")
    peer = request.client.host if request.client else ""
    caller = caller_of(peer, forwarded, site.workspace.settings.web_proxies)
    wait_s = site.wrong_tokens.wait_s(caller, secret)
    if wait_s > 0:
        raise Refused(
            429,
            "Too many wrong tokens came from this address.",
            f"Try again in {wait_s:.0f} s, with a token that is in force.",
            {"Retry-After": f"{math.ceil(wait_s)}"},
        )
    token = site.store.upkeep.token_of(secret, utc_now())
    if token is None:
        site.wrong_tokens.note_wrong(caller)
        raise _nobody("This token is wrong or revoked.")
    site.wrong_tokens.note_right(secret)
    return token


def _visitor(request: Request, site: Site, secret: str, scope: Scope) -> Visitor:
    token = token_in_force(request, site, secret)
    if scope not in token.scopes:
        raise Refused(
            403,
            f"The token {token.name} may not {scope}.",
            f"Make one that may: `shm token create NAME --scope {scope}`.",
        )
    return Visitor(token.name, Scope.WRITE in token.scopes)


def _at_home(request: Request, site: Site) -> Visitor:
    """Here reading needs no token: a cookie that is out of date takes nothing away."""
    secret = request.cookies.get(COOKIE)
    token = site.store.upkeep.token_of(secret, utc_now()) if secret else None
    return Visitor(token.name, Scope.WRITE in token.scopes) if token else Visitor("")


def _cookie(request: Request, otherwise: str) -> str:
    secret = request.cookies.get(COOKIE)
    if not secret:
        raise _nobody(otherwise)
    return secret


def _is_at_home(request: Request, site: Site) -> bool:
    """A proxy on this machine brings strangers in: what it passes on needs a token too."""
    return site.address.is_loopback and not any(name in request.headers for name in _FORWARDED)


def _nobody(message: str) -> Refused:
    return Refused(
        401,
        message,
        "Send the header `Authorization: Bearer TOKEN`; `shm token create` makes one.",
        {"WWW-Authenticate": "Bearer"},
    )
