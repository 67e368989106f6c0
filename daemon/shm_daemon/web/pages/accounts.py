"""Signing in: a person gives name and password, or a token, once; the browser keeps a secret where
no script can read it.

The pages where a person changes the own password, and where engineers let people in, change what
they may, and end them.
"""

from __future__ import annotations

from fastapi import APIRouter, Request, Response
from fastapi.responses import RedirectResponse
from starlette.concurrency import run_in_threadpool

from shm.errors import NothingThere, UsageError
from shm.pipeline import utc_now
from shm.store.people import SESSION, SIGNED_IN_FOR, People, Role
from shm_daemon.web.access import (
    COOKIE,
    AtSite,
    Engineer,
    Person,
    change_own_password,
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


@router.get("/password")
def password_page(request: Request, _: Person, changed: bool = False) -> Response:
    """Asks for the old password and, twice, for the new one."""
    return page(request, "password.html.j2", message="", changed=changed)


@router.post("/password")
async def change(request: Request, site: AtSite, person: Person) -> Response:
    """Changes it; other browsers of the person are signed out."""
    told = await form_of(request)
    try:
        await run_in_threadpool(_change, request, site, person, told)
    except UsageError as error:
        status, said = 409, f"{error.message} {error.remedy}"
    except Refused as error:
        status, said = error.status_code, f"{error.detail} {error.remedy}"
    else:
        return RedirectResponse("/password?changed=true", 303)
    content = {"message": said, "changed": False}
    return await run_in_threadpool(page, request, "password.html.j2", status=status, **content)


def _change(request: Request, site: Site, person: Person, told: dict[str, str]) -> None:
    if told.get("password", "") != told.get("again", ""):
        raise UsageError("the new passwords differ.", remedy="Type the same one twice.")
    change_own_password(request, site, person, told.get("old", ""), told.get("password", ""))


@router.get("/users")
def users_page(request: Request, site: AtSite, _: Engineer) -> Response:
    """Who may sign in, and as what."""
    return _page(request, site)


@router.post("/users")
async def change_user(request: Request, site: AtSite, engineer: Engineer) -> Response:
    """Adds or removes a user, changes their role or sets a password."""
    told = await form_of(request)
    people = site.store.acting_as(engineer.actor).people
    by_provider = site.workspace.bridge.single_sign_on is not None
    try:
        await run_in_threadpool(_change_user, people, told, by_provider)
    except (UsageError, NothingThere) as error:
        said = f"{error.message} {error.remedy}"
        return await run_in_threadpool(_page, request, site, said, 409)
    return RedirectResponse("/users", 303)


def _change_user(people: People, told: dict[str, str], by_provider: bool) -> None:
    name, password, at = told.get("name", ""), told.get("password", ""), utc_now()
    role = next((each for each in Role if each == told.get("role", "")), None)
    match told.get("action", ""), role:
        case "add", Role():
            people.add(name, role, None if by_provider and not password else password, at)
        case "role", Role():
            people.set_role(name, role, at)
        case "password", _:
            people.set_password(name, password, at)
        case "remove", _:
            people.remove(name, at)
        case _:
            raise UsageError("nothing was asked for.", remedy="Choose a button of this page.")


def _page(request: Request, site: Site, message: str = "", status: int = 200) -> Response:
    found = [each for each in site.store.people.list_all() if each.removed_at is None]
    return page(
        request, "users.html.j2", status=status, message=message, users=found, roles=list(Role)
    )
