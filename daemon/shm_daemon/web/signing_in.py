"""Signing in: a person gives name and password, or a token, once; the browser keeps a secret where
no script can read it.
"""

from __future__ import annotations

from fastapi import APIRouter, Request, Response
from fastapi.responses import RedirectResponse
from starlette.concurrency import run_in_threadpool

from shm.pipeline import utc_now
from shm.store.people import SESSION, SIGNED_IN_FOR
from shm_daemon.web.access import (
    COOKIE,
    AtSite,
    is_signed_in,
    refuse_foreign,
    session_of,
    visitor_in_force,
)
from shm_daemon.web.faults import Refused
from shm_daemon.web.forms import form_of
from shm_daemon.web.frame import for_a_person, page
from shm_daemon.web.middleware import is_https
from shm_daemon.web.site import Site

router = APIRouter(include_in_schema=False)

_LONGEST_FORM_BYTES = 8192  # technical: of anybody; a token and an address have some hundreds
_KEPT_S = int(SIGNED_IN_FOR.total_seconds())


@router.get("/sign-in")
def sign_in_page(request: Request, site: AtSite, next: str = "/") -> Response:
    """Asks for name and password, or for a token; who has signed in already goes on."""
    if is_signed_in(request, site):
        return RedirectResponse(ours(next), 303)
    return ask(request, next)


@router.post("/sign-in")
async def sign_in(request: Request, site: AtSite) -> Response:
    """Gives the cookie to who signs in; removing the user or revoking the token ends it at once."""
    refuse_foreign(request)
    told = await form_of(request, _LONGEST_FORM_BYTES)
    wanted = told.get("next", "/")
    try:
        secret = await run_in_threadpool(_secret, request, site, told)
    except Refused as refused:
        if not for_a_person(request):
            raise
        return ask(request, wanted, refused.status_code, refused.detail)
    answer = RedirectResponse(ours(wanted), 303)
    keep_signed_in(request, answer, secret)
    return answer


def keep_signed_in(request: Request, answer: Response, secret: str) -> None:
    """Has the browser keep the secret of a session."""
    answer.set_cookie(
        COOKIE,
        secret,
        max_age=_KEPT_S,
        httponly=True,
        samesite="strict",
        secure=is_https(request.scope),
    )


@router.post("/sign-out")
def sign_out(request: Request, site: AtSite) -> Response:
    """Ends the session and takes the cookie back."""
    refuse_foreign(request)
    secret = request.cookies.get(COOKIE, "")
    if secret.startswith(SESSION):
        site.store.people.sign_out(secret, utc_now())
    answer = RedirectResponse("/sign-in", 303)
    answer.delete_cookie(COOKIE, httponly=True, samesite="strict", secure=is_https(request.scope))
    return answer


def _secret(request: Request, site: Site, told: dict[str, str]) -> str:
    """What the cookie is to hold; raises Refused."""
    if "name" in told:
        return session_of(request, site, told["name"], told.get("password", ""))
    secret = told.get("token", "").strip()
    visitor_in_force(request, site, secret)
    return secret


def ask(request: Request, wanted: str, status: int = 200, message: str = "") -> Response:
    """The page that asks who one is, with what went wrong."""
    return page(
        request,
        "sign_in.html.j2",
        status=status,
        message=message,
        next=ours(wanted),
    )


def ours(wanted: str) -> str:
    """An address of this site: nobody is sent elsewhere after signing in."""
    plain = wanted.startswith("/") and wanted.isascii() and wanted.isprintable()
    return wanted if plain and not wanted.startswith("//") and "\\" not in wanted else "/"
