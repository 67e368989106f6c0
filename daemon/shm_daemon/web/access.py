"""Access: people and their roles, tokens and their scopes.

A program sends its token in a header; a browser sends the cookie that signing in gave it.
"""

from __future__ import annotations

import asyncio
import math
from collections import Counter
from collections.abc import AsyncIterator, Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Annotated
from urllib.parse import urlsplit

from fastapi import Depends, Request, Response
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer

from shm.pipeline import utc_now
from shm.store import Scope
from shm.store.journal import Actor
from shm.store.people import SESSION
from shm.store.rows import Role
from shm_daemon.web.address import caller_of
from shm_daemon.web.faults import Refused
from shm_daemon.web.middleware import PLACES, Kind
from shm_daemon.web.site import Site

COOKIE = "shm_token"
"""Holds the session of a person, or the token, that has signed in at `/sign-in`."""
_bearer = HTTPBearer(
    auto_error=False,
    description="`shm token create NAME --scope read|write` makes one. Reading from the machine "
    "itself needs none while the interface listens there only. A browser that has signed in sends "
    "a cookie instead.",
)
_BY_HEADER = "Send the header `Authorization: Bearer TOKEN`; `shm token create` makes one."
API, PAGE = "API", "page"
_FORWARDED = ("forwarded", "x-forwarded-for", "x-forwarded-host", "x-real-ip")


@dataclass(frozen=True)
class Principal:
    """The caller: the name of the person or token, empty for this machine without one."""

    name: str
    role: Role = Role.READER
    is_person: bool = False
    via: str = API

    @property
    def may_write(self) -> bool:
        return self.role.may(Role.OPERATOR)

    @property
    def is_engineer(self) -> bool:
        return self.role.may(Role.ENGINEER)

    @property
    def actor(self) -> Actor:
        """Return the author of their changes for the audit log."""
        return Actor(self.name if self.is_person else f"token {self.name}", self.via)


def site_of(request: Request) -> Site:
    """Return the site that the app serves."""
    site = request.app.state.site
    assert isinstance(site, Site)
    return site


AtSite = Annotated[Site, Depends(site_of)]
Credentials = Annotated[HTTPAuthorizationCredentials | None, Depends(_bearer)]


def reading(request: Request, site: AtSite, credentials: Credentials) -> Principal:
    """Let in who may read: this machine where only it can come in, else a token.

    `frame.page` shows who it is.
    """
    if credentials is not None:
        found = _visitor(request, site, credentials.credentials, Role.READER)
    elif _is_at_home(request, site):
        # Here reading needs no token: a cookie that is out of date takes nothing away.
        secret = request.cookies.get(COOKIE)
        found = (_found(site, secret) if secret else None) or Principal("")
    else:
        found = _signed_in(request, site, "Reading needs a user or a token here.", Role.READER)
    request.state.visitor = found
    return found


def writing(request: Request, site: AtSite, credentials: Credentials) -> Principal:
    """Let in who may write: only signed in or with a token."""
    if credentials is not None:
        return _visitor(request, site, credentials.credentials, Role.OPERATOR)
    return _signed_in(request, site, "Writing needs a user or a token.", Role.OPERATOR)


def engineering(request: Request, site: AtSite) -> Principal:
    """Let in engineers, in a browser: no token is one."""
    found = _signed_in(request, site, "This needs an engineer.", Role.ENGINEER)
    request.state.visitor = found
    return found


def signed_in_person(request: Request, site: AtSite) -> Principal:
    """Let in people who have signed in by name, with any role."""
    found = _signed_in(request, site, "This needs a person.", Role.READER)
    request.state.visitor = found
    if not found.is_person:
        raise Refused(403, "A token has no password.", "Sign in by your name.")
    return found


Reader = Annotated[Principal, Depends(reading)]
Writer = Annotated[Principal, Depends(writing)]
Engineer = Annotated[Principal, Depends(engineering)]
Person = Annotated[Principal, Depends(signed_in_person)]


async def uploading(request: Request, visitor: Writer) -> AsyncIterator[Principal]:
    """Let in who may write, to no more than a third of the places of uploads at once.

    How long a body takes is up to its sender: nobody alone may keep all the others out.
    """
    taken: Counter[str] = request.app.state.uploads
    who, most = visitor.actor.name, PLACES[Kind.UPLOAD] // 3
    if taken[who] >= most:
        raise Refused(
            503,
            f"{who} sends {most} files already.",
            "Send fewer at once, or give each logger a token of its own: `shm token create NAME "
            "--scope write`.",
            {"Retry-After": "5"},
        )
    taken[who] += 1
    try:
        yield visitor
    finally:
        taken[who] -= 1
        if not taken[who]:
            del taken[who]


Uploader = Annotated[Principal, Depends(uploading)]


async def with_passwords(request: Request, does: Callable[[], Response]) -> Response:
    """Do what hashes a password in the one thread for that, with as many waiting as may come.

    None of the threads that answer is taken, and the cores stay free for them.
    """
    loop = asyncio.get_running_loop()
    thread: Executor = request.app.state.passwords
    return await loop.run_in_executor(thread, does)


def refuse_foreign(request: Request) -> None:
    """Raise Refused where a page of somebody else has a browser send this.

    Browsers name the page's origin with whatever changes something; SameSite alone lets pages of
    other ports of this machine through.
    """
    origin, host = request.headers.get("origin", ""), request.headers.get("host", "")
    if not origin or urlsplit(origin).netloc.lower() != host.lower():
        raise Refused(403, "This was sent by a page of another site.", "Send it from our page.")


def visitor_in_force(request: Request, site: Site, secret: str) -> Principal:
    """Return the caller of a token or session; raises Refused if it is wrong or has ended.

    One in force is never kept waiting, whatever came from the same address.
    """
    found = _found(site, secret)
    if found is not None:
        return found
    if secret.startswith(SESSION):
        raise _not_signed_in("You are not signed in any more.", "Sign in again at /sign-in.")
    site.wrong_attempts.note_wrong(unless_throttled(request, site))
    raise _not_signed_in("This token is wrong or revoked.", _BY_HEADER)


def is_signed_in(request: Request, site: Site) -> bool:
    """Return True if the browser's cookie is valid."""
    secret = request.cookies.get(COOKIE)
    return bool(secret) and _found(site, secret or "") is not None


def session_of(request: Request, site: Site, name: str, password: str) -> str:
    """Return the secret of a new session; raises Refused for a wrong name or password.

    Raises it, too, after too many wrong ones.
    """
    caller = unless_throttled(request, site, name)
    secret = site.store.people.sign_in(name, password, utc_now())
    if secret is None:
        site.wrong_attempts.note_wrong(caller, name)
        raise _not_signed_in(
            "Name or password is wrong.",
            "An engineer can give you another password. A program signs in with no password: it "
            "sends a token.",
        )
    return secret


def change_password_of(
    request: Request, site: Site, person: Principal, old: str, password: str
) -> None:
    """Set a person's password; the browser that asks stays signed in.

    Raises UsageError where the new one is poor, Refused where the old one is wrong or after too
    many wrong ones.
    """
    caller = unless_throttled(request, site, person.name)
    people, secret = site.store.acting_as(person.actor).people, request.cookies.get(COOKIE, "")
    if not people.change_password(person.name, old, password, utc_now(), secret):
        site.wrong_attempts.note_wrong(caller, person.name)
        raise Refused(403, "The old password is wrong.", "An engineer can give you another one.")


def unless_throttled(request: Request, site: Site, name: str | None = None) -> str:
    """Return the address that asks; raises Refused where too much that is wrong came from there."""
    forwarded = request.headers.get("x-forwarded-for", "")
    peer = request.client.host if request.client else ""
    caller = caller_of(peer, forwarded, site.workspace.settings.web_proxies)
    wait_s = site.wrong_attempts.wait_s(caller, name)
    if wait_s > 0:
        raise Refused(
            429,
            "Too many wrong tokens or passwords came from this address or for this user.",
            f"Try again in {wait_s:.0f} s, with one that is in force.",
            {"Retry-After": f"{math.ceil(wait_s)}"},
        )
    return caller


def _found(site: Site, secret: str) -> Principal | None:
    if secret.startswith(SESSION):
        user = site.store.people.user_of(secret, utc_now())
        return None if user is None else Principal(user.name, user.role, is_person=True)
    token = site.store.upkeep.token_of(secret, utc_now())
    if token is None:
        return None
    return Principal(token.name, Role.OPERATOR if Scope.WRITE in token.scopes else Role.READER)


def _visitor(request: Request, site: Site, secret: str, needed: Role) -> Principal:
    """Return the caller if its role is enough; raises Refused. No other place checks roles."""
    found = visitor_in_force(request, site, secret)
    if found.role.may(needed):
        return found
    if found.is_person:
        raise Refused(
            403,
            f"The role {found.role} may not do this.",
            f"It takes the role {needed}: ask an engineer.",
        )
    if needed is Role.ENGINEER:
        raise Refused(403, "A token may not do this.", "Sign in as an engineer, by your name.")
    raise Refused(
        403,
        f"The token {found.name} may not write.",
        "Make one that may: `shm token create NAME --scope write`.",
    )


def _signed_in(request: Request, site: Site, otherwise: str, needed: Role) -> Principal:
    """Return the person signed in with this browser; raises Refused with `otherwise` if none is."""
    secret = request.cookies.get(COOKIE)
    if not secret:
        raise _not_signed_in(otherwise, f"Sign in at /sign-in. A program: {_BY_HEADER}")
    if request.method not in ("GET", "HEAD"):
        refuse_foreign(request)
    return replace(_visitor(request, site, secret, needed), via=PAGE)


def _is_at_home(request: Request, site: Site) -> bool:
    """Return True for a caller on this machine; a request through a proxy needs a token, too."""
    return site.address.is_loopback and not any(name in request.headers for name in _FORWARDED)


def _not_signed_in(message: str, remedy: str) -> Refused:
    return Refused(401, message, remedy, {"WWW-Authenticate": "Bearer"})
