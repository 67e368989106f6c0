"""Sign people in by password, token or OpenID Connect, and out; change passwords.

The browser keeps a secret where no script can read it.
"""

from __future__ import annotations

import logging
import secrets
import threading
from collections import OrderedDict
from collections.abc import Mapping
from datetime import datetime, timedelta
from functools import partial
from typing import TYPE_CHECKING

from fastapi import APIRouter, Depends, Request, Response
from fastapi.responses import RedirectResponse
from starlette.concurrency import run_in_threadpool

from shm.bridge.description import SingleSignOn
from shm.errors import NothingThere, ShmError, UsageError, needing
from shm.pipeline import utc_now
from shm.store.people import SESSION, SIGNED_IN_FOR
from shm_daemon.web.access import (
    COOKIE,
    AtSite,
    Person,
    change_password_of,
    is_signed_in,
    refuse_foreign,
    session_of,
    unless_throttled,
    visitor_in_force,
    with_passwords,
)
from shm_daemon.web.faults import Refused
from shm_daemon.web.forms import Form, FormOfAnybody, redirect_or_show_error
from shm_daemon.web.frame import for_a_person, page
from shm_daemon.web.middleware import is_https
from shm_daemon.web.site import Site

if TYPE_CHECKING:
    from shm_daemon.openid import Begun, Provider

router = APIRouter(include_in_schema=False)

_COOKIE_S = int(SIGNED_IN_FOR.total_seconds())
_BACK = "/sign-in/back"
_COOKIE, _ITS_PATH = "shm_sign_on", "/sign-in"
_WITHIN = timedelta(minutes=10)  # judgement: to type a password and confirm on a telephone
_MOST = 1024  # technical: a megabyte of memory; the oldest are forgotten
_FORGOTTEN = (
    "This sign-in was begun in another browser, too long ago, or is used up. Begin it again."
)

log = logging.getLogger(__name__)


@router.get("/sign-in")
def sign_in_page(request: Request, site: AtSite, next: str = "/") -> Response:
    """Ask for name and password, or for a token; who has signed in already goes on."""
    if is_signed_in(request, site):
        return RedirectResponse(_ours(next), 303)
    return _ask(request, next)


@router.post("/sign-in", dependencies=[Depends(refuse_foreign)])
async def sign_in(request: Request, site: AtSite, form: FormOfAnybody) -> Response:
    """Give the cookie to who signs in; removing the user or revoking the token ends it at once."""
    let_in = partial(_let_in, request, site, form)
    return await (with_passwords(request, let_in) if "name" in form else run_in_threadpool(let_in))


def _let_in(request: Request, site: Site, form: Mapping[str, str]) -> Response:
    wanted, secret = form.get("next", "/"), form.get("token", "").strip()
    try:
        if "name" in form:
            secret = session_of(request, site, form["name"], form.get("password", ""))
        else:
            visitor_in_force(request, site, secret)
    except Refused as refused:
        if not for_a_person(request):
            raise
        return _ask(request, wanted, refused.status_code, refused.detail)
    answer = RedirectResponse(_ours(wanted), 303)
    _keep_signed_in(request, answer, secret)
    return answer


def _keep_signed_in(request: Request, answer: Response, secret: str) -> None:
    """Have the browser keep the secret of a session."""
    answer.set_cookie(COOKIE, secret, max_age=_COOKIE_S, httponly=True, samesite="strict",
                      secure=is_https(request.scope))  # fmt: skip


@router.post("/sign-out", dependencies=[Depends(refuse_foreign)])
def sign_out(request: Request, site: AtSite) -> Response:
    """End the session and remove the cookie."""
    secret = request.cookies.get(COOKIE, "")
    if secret.startswith(SESSION):
        site.store.people.sign_out(secret, utc_now())
    answer = RedirectResponse("/sign-in", 303)
    answer.delete_cookie(COOKIE, httponly=True, samesite="strict", secure=is_https(request.scope))
    return answer


def _ask(request: Request, wanted: str, status: int = 200, message: str = "") -> Response:
    """Return the page that asks who one is, with what went wrong."""
    return page(request, "sign_in.html.j2", status=status, message=message, next=_ours(wanted))


def _ours(wanted: str) -> str:
    """Return an address of this site: nobody is sent elsewhere after signing in."""
    plain = wanted.startswith("/") and wanted.isascii() and wanted.isprintable()
    return wanted if plain and not wanted.startswith("//") and "\\" not in wanted else "/"


@router.get("/password")
def password_page(request: Request, _: Person, changed: bool = False) -> Response:
    """Ask for the old password and, twice, for the new one."""
    return page(request, "password.html.j2", message="", changed=changed)


@router.post("/password")
async def change_password(request: Request, site: AtSite, person: Person, form: Form) -> Response:
    """Change it; other browsers of the person are signed out."""
    password = form.get("password", "")

    def change() -> None:
        if password != form.get("again", ""):
            raise UsageError("the new passwords differ.", remedy="Type the same one twice.")
        change_password_of(request, site, person, form.get("old", ""), password)

    def again(message: str, status: int) -> Response:
        return page(request, "password.html.j2", status=status, message=message, changed=False)

    done = partial(redirect_or_show_error, change, "/password?changed=true", again)
    return await with_passwords(request, done)


class SignOns:
    """Hold the provider as it is described now, and pending sign-ins, each usable once.

    May be used from many threads.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._begun: OrderedDict[str, tuple[datetime, Begun, str]] = OrderedDict()
        self._provider: Provider | None = None

    def provider(self, described: SingleSignOn | None) -> Provider:
        """Raise NothingThere where none is described, UsageError where the extra is missing."""
        if described is None:
            raise NothingThere(
                "This bridge has no single sign-on.", remedy="Sign in with a password."
            )
        with needing("sso"):
            from shm_daemon.openid import Provider  # an extra
        with self._lock:
            if self._provider is None or self._provider.described != described:
                self._provider = Provider(described)
            return self._provider

    def note(self, begun: Begun, wanted: str) -> None:
        """Record a pending sign-in and the page to open after it."""
        with self._lock:
            self._begun[begun.state] = utc_now(), begun, wanted
            while len(self._begun) > _MOST:
                self._begun.popitem(last=False)

    def take(self, state: str) -> tuple[Begun, str] | None:
        """Return the stored data of a state, once and in time."""
        with self._lock:
            noted = self._begun.pop(state, None)
        return noted[1:] if noted is not None and utc_now() - noted[0] < _WITHIN else None


@router.get("/sign-in/provider")
def begin(request: Request, site: AtSite, next: str = "/") -> Response:
    """Send a person to the provider."""
    signs: SignOns = request.app.state.sign_ons
    host = request.headers["host"]  # one of ours: the middleware has looked
    back = f"http{'s' if is_https(request.scope) else ''}://{host}{_BACK}"
    try:
        begun = signs.provider(site.workspace.bridge.single_sign_on).begin(back)
    except ShmError as error:
        return _show_error(request, next, error)
    signs.note(begun, _ours(next))
    answer = RedirectResponse(begun.url, 303)
    # Lax: it must come back with a person whom a page of the provider sends.
    answer.set_cookie(_COOKIE, begun.state, max_age=int(_WITHIN.total_seconds()), path=_ITS_PATH,
                      httponly=True, samesite="lax", secure=is_https(request.scope))  # fmt: skip
    return answer


@router.get(_BACK)
def come_back(
    request: Request, site: AtSite, state: str = "", code: str = "", error: str = ""
) -> Response:
    """Sign in the user whom the provider names; by default nobody is one."""
    caller, signs = unless_throttled(request, site), request.app.state.sign_ons
    cookie = request.cookies.get(_COOKIE, "")
    is_its_browser = secrets.compare_digest(cookie.encode(), state.encode())
    noted = signs.take(state) if is_its_browser else None
    if noted is None:
        return _refused(request, "/", 403, _FORGOTTEN)
    begun, wanted = noted
    if error or not code:
        log.warning("single sign-on was not completed: %.80r", error or "no code came")
        message = "You have not signed in there" + (f" ({error[:80]})." if error else ".")
        return _refused(request, wanted, 403, message)
    try:
        name = signs.provider(site.workspace.bridge.single_sign_on).name_of(begun, code)
    except ShmError as failure:
        if failure.retry_after_s is None:
            site.wrong_attempts.note_wrong(caller)
        return _show_error(request, wanted, failure)
    return _signed_in(request, site, name, wanted)


def _signed_in(request: Request, site: Site, name: str, wanted: str) -> Response:
    try:
        secret = site.store.people.sign_in_as(name, utc_now())
    except UsageError as error:
        return _show_error(request, wanted, error)
    if secret is None:
        log.warning("single sign-on: %.255r is no user of this bridge", name)
        return _refused(
            request,
            wanted,
            403,
            "You are not a user of this bridge yet. Ask an engineer of it to add, on the page "
            "Users, a user of exactly this name, in place of one that differs in capitals alone: "
            f"{name}",
        )
    # No redirect: a browser that came from elsewhere would not send the strict cookie along.
    answer = page(request, "signed_in.html.j2", name=name, next=wanted)
    _keep_signed_in(request, answer, secret)
    answer.delete_cookie(_COOKIE, path=_ITS_PATH)
    return answer


def _show_error(request: Request, wanted: str, error: ShmError) -> Response:
    log.warning("single sign-on: %s", error)
    passing = error.retry_after_s is not None
    return _refused(request, wanted, 503 if passing else 403, f"{error.message} {error.remedy}")


def _refused(request: Request, wanted: str, status: int, message: str) -> Response:
    answer = _ask(request, wanted, status, message)
    answer.delete_cookie(_COOKIE, path=_ITS_PATH)
    return answer
