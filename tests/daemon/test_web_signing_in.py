"""Signing in with a token: the cookie, what it opens, and how it ends."""

from __future__ import annotations

from collections.abc import Iterator

import httpx
import pytest

from shm.store import Workspace
from shm_daemon.web.access import COOKIE
from shm_daemon.web.address import Address
from tests.helpers.web_servers import Served, served

ELSEWHERE = Address("0.0.0.0")
BROWSER = {"Accept": "text/html"}
UPLOAD = "/api/recordings?name=x.csv"


@pytest.fixture
def elsewhere(workspace: Workspace) -> Iterator[Served]:
    with served(workspace, ELSEWHERE) as site:
        yield site


@pytest.fixture
def browser(elsewhere: Served) -> Iterator[httpx.Client]:
    """As a browser has it: it names the origin of what it sends."""
    with elsewhere.client(**BROWSER, Origin=elsewhere.url) as client:
        yield client


def sign_in(client: httpx.Client, token: str, wanted: str = "/", **headers: str) -> httpx.Response:
    return client.post("/sign-in", data={"token": token, "next": wanted}, headers=headers)


def test_a_token_given_once_opens_the_pages(browser: httpx.Client, elsewhere: Served) -> None:
    refused = browser.get("/alerts")
    assert refused.status_code == 401
    assert 'name="next" value="/alerts"' in refused.text
    entered = sign_in(browser, elsewhere.read_token, "/alerts")
    assert (entered.status_code, entered.headers["Location"]) == (303, "/alerts")
    assert browser.get("/alerts").status_code == 200
    assert browser.get("/api/status").status_code == 200


def test_over_https_the_cookie_never_travels_in_clear(
    browser: httpx.Client, elsewhere: Served
) -> None:
    entered = sign_in(browser, elsewhere.read_token, **{"X-Forwarded-Proto": "https"})
    assert "; Secure" in entered.headers["Set-Cookie"]


def test_the_cookie_lasts_a_month_for_this_site_alone_and_out_of_reach_of_scripts(
    browser: httpx.Client, elsewhere: Served
) -> None:
    def attributes(answer: httpx.Response) -> set[str]:
        found = answer.headers["Set-Cookie"].split("; ")[1:]
        return {each.lower() for each in found if not each.lower().startswith("expires=")}

    kept = {"httponly", "path=/", "samesite=strict"}
    assert attributes(sign_in(browser, elsewhere.read_token)) == kept | {"max-age=2592000"}
    assert attributes(browser.post("/sign-out")) == kept | {"max-age=0"}


def test_a_wrong_token_is_said_on_the_page(browser: httpx.Client) -> None:
    for token in ("shm_wrong", "", "é", "x" * 4000):
        refused = sign_in(browser, token)
        assert refused.status_code == 401
        assert "wrong or revoked" in refused.text
        assert "Set-Cookie" not in refused.headers
    assert sign_in(browser, "x" * 10_000).status_code == 413


@pytest.mark.parametrize("origin", ["https://evil.example", "http://127.0.0.1:1", "null", ""])
def test_a_page_of_another_site_can_send_nothing(
    browser: httpx.Client, elsewhere: Served, origin: str
) -> None:
    sign_in(browser, elsewhere.write_token)
    foreign = {"Origin": origin}
    assert browser.post(UPLOAD, content=b"x", headers=foreign).status_code == 403
    assert browser.post("/sign-out", headers=foreign).status_code == 403
    assert sign_in(browser, elsewhere.read_token, **foreign).status_code == 403
    told = {"why": "seen"}
    posted = browser.post("/api/alerts/1/acknowledgement", json=told, headers=foreign)
    assert posted.status_code == 403


def test_who_signs_out_is_out(browser: httpx.Client, elsewhere: Served) -> None:
    sign_in(browser, elsewhere.read_token)
    assert browser.post("/sign-out").status_code == 303
    assert COOKIE not in browser.cookies
    assert browser.get("/").status_code == 401


def test_a_header_goes_before_the_cookie(browser: httpx.Client, elsewhere: Served) -> None:
    sign_in(browser, elsewhere.write_token)
    wrong = {"Authorization": "Bearer shm_wrong"}
    assert browser.get("/api/status", headers=wrong).status_code == 401


def test_nobody_is_sent_elsewhere_after_signing_in(
    browser: httpx.Client, elsewhere: Served
) -> None:
    for wanted in (
        "https://evil.example",
        "//evil.example",
        "/\\evil.example",
        "evil",
        "/\r\nX: y",
    ):
        assert sign_in(browser, elsewhere.read_token, wanted).headers["Location"] == "/"


def test_a_cookie_out_of_date_takes_nothing_from_this_machine(workspace: Workspace) -> None:
    with served(workspace) as site, site.client(**BROWSER) as client:
        client.cookies.set(COOKIE, "shm_old")
        page = client.get("/")
    assert page.status_code == 200
    assert 'href="/sign-in"' in page.text
