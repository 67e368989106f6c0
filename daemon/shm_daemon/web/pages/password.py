"""The page where a person changes the own password."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response
from fastapi.responses import RedirectResponse
from starlette.concurrency import run_in_threadpool

from shm.errors import UsageError
from shm_daemon.web.access import AtSite, Person, change_own_password
from shm_daemon.web.faults import Refused
from shm_daemon.web.forms import form_of
from shm_daemon.web.frame import page
from shm_daemon.web.site import Site

router = APIRouter(include_in_schema=False)


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
