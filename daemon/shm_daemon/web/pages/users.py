"""Users and audit log: engineers add people, change their roles, end their access."""

from __future__ import annotations

from functools import partial

from fastapi import APIRouter, Request, Response

from shm.errors import UsageError
from shm.pipeline import utc_now
from shm.report import formatting
from shm.report.paper import Table
from shm.store.journal import change_document, list_changes
from shm.store.rows import Role
from shm_daemon.web.access import AtSite, Engineer, with_passwords
from shm_daemon.web.forms import Form, redirect_or_show_error
from shm_daemon.web.frame import page
from shm_daemon.web.models import Before, paged
from shm_daemon.web.site import Site

router = APIRouter(include_in_schema=False)

_SHOWN = 100  # technical: changes on a page, which links to older ones


@router.get("/users")
def users_page(request: Request, site: AtSite, _: Engineer) -> Response:
    """Show the users and their roles."""
    return _page(request, site)


@router.post("/users")
async def change_user(request: Request, site: AtSite, engineer: Engineer, form: Form) -> Response:
    """Add or remove a user, change their role or set a password."""
    people, at = site.store.acting_as(engineer.actor).people, utc_now()
    by_provider = site.workspace.bridge.single_sign_on is not None
    name, password = form.get("name", ""), form.get("password", "")
    role = next((each for each in Role if each == form.get("role", "")), None)

    def change() -> None:
        match form.get("action", ""), role:
            case "add", Role():
                people.add(name, role, None if by_provider and not password else password, at)
            case "role", Role():
                people.set_role(name, role, at)
            case "single-sign-on", _ if by_provider:
                people.set_single_sign_on(name, at)
            case "password", _:
                people.set_password(name, password, at)
            case "remove", _:
                people.remove(name, at)
            case _:
                raise UsageError("nothing was asked for.", remedy="Choose a button of this page.")

    again = partial(_page, request, site)
    return await with_passwords(request, partial(redirect_or_show_error, change, "/users", again))


def _page(request: Request, site: Site, message: str = "", status: int = 200) -> Response:
    found = [each for each in site.store.people.list_all() if each.removed_at is None]
    return page(
        request, "users.html.j2", status=status, message=message, users=found, roles=list(Role)
    )


@router.get("/audit")
def audit_page(request: Request, site: AtSite, _: Engineer, before: Before = None) -> Response:
    """Show the changes by people through page, API or command line, the newest first."""
    shown, older = paged(list_changes(site.store, _SHOWN + 1, before), _SHOWN)
    table = Table(
        "Changes",
        ("time", "who", "by", "action", "of", "detail"),
        tuple(
            (formatting.moment(each.at), *list(change_document(each).values())[2:])
            for each in shown
        ),
    )
    return page(request, "audit.html.j2", table=table, older=older, is_first=before is None)
