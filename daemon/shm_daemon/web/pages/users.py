"""The page where engineers let people in, change what they may, and end them."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response
from fastapi.responses import RedirectResponse
from starlette.concurrency import run_in_threadpool

from shm.errors import NothingThere, UsageError
from shm.pipeline import utc_now
from shm.store.people import People, Role
from shm_daemon.web.access import AtSite, Engineer
from shm_daemon.web.forms import form_of
from shm_daemon.web.frame import page
from shm_daemon.web.site import Site

router = APIRouter(include_in_schema=False)


@router.get("/users")
def users_page(request: Request, site: AtSite, _: Engineer) -> Response:
    """Who may sign in, and as what."""
    return _page(request, site)


@router.post("/users")
async def change(request: Request, site: AtSite, engineer: Engineer) -> Response:
    """Adds or removes a user, changes their role or sets a password."""
    told = await form_of(request)
    people = site.store.acting_as(engineer.actor).people
    by_provider = site.workspace.bridge.single_sign_on is not None
    try:
        await run_in_threadpool(_change, people, told, by_provider)
    except (UsageError, NothingThere) as error:
        said = f"{error.message} {error.remedy}"
        return await run_in_threadpool(_page, request, site, said, 409)
    return RedirectResponse("/users", 303)


def _change(people: People, told: dict[str, str], by_provider: bool) -> None:
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
