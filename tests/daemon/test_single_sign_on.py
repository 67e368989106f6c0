"""Signing in where a provider of OpenID Connect says who one is: who gets in, and who does not."""

from __future__ import annotations

import itertools
import re
import time
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl, urlsplit

import httpx
import pytest

pytest.importorskip("authlib", reason="single sign-on is untested: pip install 'shm[sso]'")

from shm.pipeline import utc_now
from shm.store import Workspace
from shm.store.rows import Role
from shm_daemon.doctor import Level, examine
from shm_daemon.web.access import COOKIE
from shm_daemon.web.address import Address
from shm_daemon.web.pages import signing_in
from tests.helpers import openid_providers
from tests.helpers.openid_providers import CLIENT, SECRET, Provider
from tests.helpers.web_servers import Served, served
from tests.helpers.workspaces import make_workspace

PASSWORD = "correct horse battery"
CALLERS = itertools.count(1)  # each test from an address of its own: what is wrong is throttled


@dataclass
class Scene:
    """A bridge whose people a provider knows."""

    workspace: Workspace
    site: Served
    provider: Provider

    def browser(self) -> httpx.Client:
        address = f"203.0.113.{next(CALLERS)}"
        return self.site.client(
            Origin=self.site.url, Accept="text/html", **{"X-Forwarded-For": address}
        )


@pytest.fixture(scope="module")
def begun(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Scene]:
    with openid_providers.running() as provider:
        workspace = described(tmp_path_factory.mktemp("sso") / "bridge", provider.issuer)
        with workspace.store() as store:
            store.people.add("ann@example.org", Role.OPERATOR, None, utc_now())
            store.people.add("Eva", Role.ENGINEER, PASSWORD, utc_now())
        with served(workspace, Address("0.0.0.0")) as site:
            yield Scene(workspace, site, provider)


def described(folder: Path, issuer: str, more: str = "") -> Workspace:
    workspace = make_workspace(folder)
    with (folder / "bridge.toml").open("a") as file:
        file.write(
            f'\n[single_sign_on]\nissuer = "{issuer}"\nclient_id = "{CLIENT}"\n'
            f'client_secret_file = "sign_on.secret"\n{more}'
        )
    secret = folder / "sign_on.secret"
    secret.write_text(f"{SECRET}\n")
    secret.chmod(0o600)
    return workspace.reopened()


@pytest.fixture
def scene(begun: Scene) -> Scene:
    """With a provider that says what is right."""
    p = begun.provider
    p.claims, p.document, p.userinfo, p.algorithm, p.signs_with = {}, {}, {}, "RS256", "its own"
    return begun


@pytest.fixture
def browser(scene: Scene) -> Iterator[httpx.Client]:
    with scene.browser() as client:
        yield client


def go(client: httpx.Client, scene: Scene, wanted: str = "/alerts") -> dict[str, str]:
    """To the provider, where the person signs in: what they come back with."""
    sent = client.get("/sign-in/provider", params={"next": wanted})
    assert sent.status_code == 303, sent.text
    return scene.provider.confirm(sent.headers["Location"])


def come(client: httpx.Client, told: dict[str, str]) -> httpx.Response:
    return client.get("/sign-in/back", params=told)


def test_whom_the_provider_knows_and_an_engineer_has_added_is_in_until_signing_out(
    scene: Scene, browser: httpx.Client
) -> None:
    asked = browser.get("/alerts")
    assert asked.status_code == 401
    link = re.search(r'href="(/sign-in/provider[^"]*)"', asked.text)
    assert link is not None
    sent = browser.get(link[1])
    query = dict(parse_qsl(urlsplit(sent.headers["Location"]).query))
    assert query["redirect_uri"] == f"{scene.site.url}/sign-in/back"
    assert len({query["state"], query["nonce"], query["code_challenge"]}) == 3
    entered = come(browser, scene.provider.confirm(sent.headers["Location"]))
    assert entered.status_code == 200
    assert 'content="0;url=/alerts"' in entered.text
    kept = next(c for c in entered.headers.get_list("set-cookie") if c.startswith(COOKIE))
    assert {"httponly", "samesite=strict"} <= set(kept.lower().split("; "))
    assert "ann@example.org" in browser.get("/alerts").text
    assert browser.get("/settings").status_code == 403  # an operator here, whatever she is there
    assert browser.post("/sign-out").status_code == 303
    assert browser.get("/alerts").status_code == 401


NOW = int(time.time())
HOUR_S = 3600


@pytest.mark.parametrize(
    ("claims", "algorithm", "signs_with", "said"),
    [
        ({"nonce": "of another sign-in"}, "RS256", "its own", "nonce"),
        ({"nonce": None}, "RS256", "its own", "nonce"),
        ({"aud": "another-client"}, "RS256", "its own", "aud"),
        ({"aud": ["another-client"], "azp": CLIENT}, "RS256", "its own", "aud"),
        ({"aud": [CLIENT, "x"], "azp": "another-client"}, "RS256", "its own", "azp"),
        ({"iss": "https://evil.example"}, "RS256", "its own", "iss"),
        ({"exp": NOW - HOUR_S}, "RS256", "its own", "expired. Set this computer&#39;s clock"),
        ({"iat": NOW + HOUR_S}, "RS256", "its own", "in the future. Set this computer&#39;s clock"),
        ({"exp": None}, "RS256", "its own", "exp"),
        ({}, "none", "its own", "does not hold"),
        ({}, "HS256", "its own", "does not hold"),
        ({}, "RS256", "somebody's", "does not hold"),
        ({"email_verified": False}, "RS256", "its own", "has not verified your address"),
        ({"email_verified": None}, "RS256", "its own", "has not verified your address"),
        ({"email": None}, "RS256", "its own", "does not say email of you"),
        ({"email": "bob@example.org"}, "RS256", "its own", "not a user of this bridge yet"),
        ({"email": "Ann@example.org"}, "RS256", "its own", "not a user of this bridge yet"),
        ({"email": "\uff41nn@example.org"}, "RS256", "its own", "not a user of this bridge yet"),
    ],
)  # fmt: skip
def test_what_proves_nobody_lets_nobody_in(
    scene: Scene, browser: httpx.Client, claims: dict[str, Any], algorithm: str, signs_with: str,
    said: str,
) -> None:  # fmt: skip
    p = scene.provider
    p.claims, p.algorithm, p.signs_with = claims, algorithm, signs_with
    refused = come(browser, go(browser, scene))
    assert refused.status_code == 403
    assert said in refused.text
    assert 'name="next" value="/alerts"' in refused.text  # a password would go on there
    assert COOKIE not in browser.cookies
    assert browser.get("/alerts").status_code == 401


def test_a_sign_in_is_of_use_once_in_its_own_browser_and_soon(
    scene: Scene, browser: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = go(browser, scene)
    kept = dict(browser.cookies)
    with scene.browser() as other:
        assert come(other, told).status_code == 403
        go(other, scene)
        assert come(other, told).status_code == 403
    assert come(browser, {**told, "state": ""}).status_code == 403
    browser.cookies.update(kept)
    assert come(browser, told).status_code == 200
    browser.post("/sign-out")
    browser.cookies.update(kept)
    replayed = come(browser, told)
    assert replayed.status_code == 403
    assert "Begin it again" in replayed.text
    browser.cookies.clear()
    late = go(browser, scene)
    monkeypatch.setattr(signing_in, "utc_now", lambda: utc_now() + timedelta(minutes=11))
    assert come(browser, late).status_code == 403


def test_claims_may_come_beside_the_token_but_of_the_same_person(
    scene: Scene, browser: httpx.Client
) -> None:
    scene.provider.claims = {"email": None, "email_verified": None}
    right = {"sub": "248289761001", "email": "ann@example.org", "email_verified": True}
    scene.provider.userinfo = {**right, "sub": "another"}
    assert come(browser, go(browser, scene)).status_code == 403
    scene.provider.userinfo = right
    assert come(browser, go(browser, scene)).status_code == 200


def test_a_removed_user_is_out_and_stays_out_while_passwords_remain_beside(
    scene: Scene, browser: httpx.Client
) -> None:
    with scene.workspace.store() as store:
        store.people.add("bob@example.org", Role.READER, None, utc_now())
    scene.provider.claims = {"email": "bob@example.org"}
    assert come(browser, go(browser, scene)).status_code == 200
    with scene.workspace.store() as store:
        store.people.remove("bob@example.org", utc_now())
    assert browser.get("/alerts").status_code == 401
    assert come(browser, go(browser, scene)).status_code == 403
    assert browser.post("/sign-in", data={"name": "Eva", "password": PASSWORD}).status_code == 303
    added = {"action": "add", "name": "bob@example.org", "role": "reader", "password": ""}
    assert browser.post("/users", data=added).status_code == 303
    browser.post("/sign-out")
    assert come(browser, go(browser, scene)).status_code == 200


def test_password_user_needs_the_password(scene: Scene, browser: httpx.Client) -> None:
    with scene.workspace.store() as store:
        store.people.add("kim@example.org", Role.ENGINEER, PASSWORD, utc_now())
    scene.provider.claims = {"email": "kim@example.org"}
    told = {"name": "kim@example.org", "password": PASSWORD}
    refused = come(browser, go(browser, scene))
    assert refused.status_code == 403
    assert COOKIE not in browser.cookies
    assert "kim@example.org signs in to this bridge with a password" in refused.text
    assert "shm user single-sign-on kim@example.org" in refused.text
    assert browser.post("/sign-in", data=told).status_code == 303
    assert "Use single sign-on" in browser.get("/users").text
    changed = {"action": "single-sign-on", "name": "kim@example.org"}
    assert browser.post("/users", data=changed).status_code == 303
    assert browser.get("/users").status_code == 401  # signed out by it
    assert browser.post("/sign-in", data=told).status_code == 401
    assert come(browser, go(browser, scene)).status_code == 200
    with scene.workspace.store() as store:
        store.people.set_password("kim@example.org", PASSWORD, utc_now())
    assert come(browser, go(browser, scene)).status_code == 403


def test_a_wrong_secret_is_told_to_the_engineer(scene: Scene, browser: httpx.Client) -> None:
    secret = scene.workspace.folder / "sign_on.secret"
    told = go(browser, scene)
    secret.write_text("another")
    refused = come(browser, told)
    secret.unlink()
    unread = browser.get("/sign-in/provider")
    secret.write_text(SECRET)
    secret.chmod(0o600)
    assert "does not take client_id and secret" in refused.text
    assert (unread.status_code, "cannot be read" in unread.text) == (403, True)


def test_a_provider_that_is_down_is_told_on_page_and_by_the_doctor(tmp_path: Path) -> None:
    with openid_providers.running() as provider:
        workspace = described(tmp_path / "bridge", provider.issuer)
        assert found(workspace) == (Level.OK, "127.0.0.1 answers")
        (workspace.folder / "sign_on.secret").chmod(0o644)
        assert found(workspace) == (Level.WARNING, "others can read sign_on.secret")
        provider.document = {"issuer": "https://another.example"}
        level, said = found(workspace)
        assert (level, "its issuer is 'https://another.example'" in said) == (Level.FAULT, True)
        provider.document = {"token_endpoint": "http://192.0.2.1/token"}
        assert found(workspace) == (Level.FAULT, "127.0.0.1 states no encrypted token_endpoint.")
        provider.document = {"jwks_uri": f"{provider.issuer}/keys"}
    assert found(workspace) == (
        Level.FAULT, "127.0.0.1 cannot be reached: Connection refused.",
    )  # fmt: skip
    with served(workspace) as site, site.client(Accept="text/html") as client:
        down = client.get("/sign-in/provider")
    assert down.status_code == 503
    assert "cannot be reached: Connection refused. Sign in with a password meanwhile" in down.text


def found(workspace: Workspace) -> tuple[Level, str]:
    """Return the last finding of the doctor about the provider."""
    of_it = [e for e in examine(workspace.folder, utc_now()) if e.check == "single sign-on"]
    return of_it[-1].level, of_it[-1].found
