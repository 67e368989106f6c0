"""Who may do what: tokens and their scopes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from fastapi import Depends, Request
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer

from shm.pipeline import utc_now
from shm.store import Scope
from shm_daemon.web.faults import Refused
from shm_daemon.web.site import Site

_bearer = HTTPBearer(
    auto_error=False,
    description="`shm token create NAME --scope read|write` makes one. Reading from the machine "
    "itself needs none while the interface listens there only.",
)
_FORWARDED = ("forwarded", "x-forwarded-for", "x-forwarded-host", "x-real-ip")


@dataclass(frozen=True)
class Visitor:
    """Who asks: the name of the token, empty for this machine without one."""

    name: str


def site_of(request: Request) -> Site:
    """The site that the app serves."""
    site = request.app.state.site
    assert isinstance(site, Site)
    return site


AtSite = Annotated[Site, Depends(site_of)]
Credentials = Annotated[HTTPAuthorizationCredentials | None, Depends(_bearer)]


def reading(request: Request, site: AtSite, credentials: Credentials) -> Visitor:
    """Lets in who may read: this machine where only it can come in, else a token."""
    if credentials is None and not _is_at_home(request, site):
        raise _nobody("Reading needs a token here.")
    return _visitor(site, credentials, Scope.READ)


def writing(request: Request, site: AtSite, credentials: Credentials) -> Visitor:
    """Lets in who may write: only with a token, from wherever."""
    if credentials is None:
        raise _nobody("Writing needs a token.")
    return _visitor(site, credentials, Scope.WRITE)


Reader = Annotated[Visitor, Depends(reading)]
Writer = Annotated[Visitor, Depends(writing)]


def _visitor(site: Site, credentials: HTTPAuthorizationCredentials | None, scope: Scope) -> Visitor:
    if credentials is None:
        return Visitor("")
    token = site.store.token_of(credentials.credentials, utc_now())
    if token is None:
        raise _nobody("This token is wrong or revoked.")
    if scope not in token.scopes:
        raise Refused(
            403,
            f"The token {token.name} may not {scope}.",
            f"Make one that may: `shm token create NAME --scope {scope}`.",
        )
    return Visitor(token.name)


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
