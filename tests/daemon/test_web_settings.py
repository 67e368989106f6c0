"""Settings and users changed in the page: what holds, what is refused, who is told."""

from __future__ import annotations

import re
from collections.abc import Iterator

import httpx
import pytest

from shm.pipeline import utc_now
from shm.store import Workspace
from shm.store.journal import list_changes
from shm_cli.main import run
from shm_daemon.doctor import examine
from tests.helpers.outboxes import make_baseline, raise_alerts
from tests.helpers.web_servers import HTML, PASSWORD, Served, add_a_user_of_each_role, sign_in

LEVEL = "hanger.3.thresholds.alert_probability"


@pytest.fixture
def browser(workspace: Workspace, at_home: Served) -> Iterator[httpx.Client]:
    """Yield a signed-in engineer."""
    add_a_user_of_each_role(workspace)
    with at_home.client(**HTML, Origin=at_home.url) as client:
        sign_in(client, "engineer")
        yield client


def put(client: httpx.Client, key: str, value: str, back: bool = False) -> httpx.Response:
    return client.post("/settings", data=filled_in(key, based_on(client, key), back, value=value))


def filled_in(key: str, opened: str, back: bool = False, **values: str) -> dict[str, str]:
    """Fill in one setting's fields in the form of a page opened at `opened`."""
    told = {f"{part}.{key}": value for part, value in values.items()}
    told |= {f"was_{part}.{key}": "as it was" for part in values}
    return {**told, f"based_on.{key}": opened or "0", **({f"back.{key}": "on"} if back else {})}


def based_on(client: httpx.Client, key: str) -> str:
    """Read what the form of a page that is opened now carries."""
    page = client.get("/settings?hanger=3").text
    found = re.search(f'name="based_on.{re.escape(key)}" value="([0-9]+)"', page)
    return found[1] if found else ""


def level(workspace: Workspace) -> float:
    return workspace.reopened().bridge.hanger(3).thresholds.alert_probability


def test_a_threshold_holds_from_now_on_and_goes_back_to_the_file(
    browser: httpx.Client, workspace: Workspace, capsys: pytest.CaptureFixture[str]
) -> None:
    in_file = level(workspace)
    assert put(browser, LEVEL, "0.9").status_code == 303
    assert level(workspace) == 0.9
    shown = browser.get("/settings?hanger=3").text
    assert f"bridge.toml: {in_file:g} · set by engineer" in shown
    told = "hanger 3 thresholds alert_probability = 0.9 instead of"
    assert any(told in each.found for each in examine(workspace.folder, utc_now()))
    assert run(["--workspace", str(workspace.folder), "status"]) == 0
    assert told in " ".join(capsys.readouterr().out.split())
    with workspace.store() as store:
        (row,) = list_changes(store, limit=1)
    assert (row.who, row.via, row.kind, row.detail) == (
        "engineer", "page", "setting changed", f"from {in_file:g} to 0.9",
    )  # fmt: skip
    put(browser, LEVEL, "", back=True)
    assert level(workspace) == in_file


def test_saving_overwrites_nothing(browser: httpx.Client, workspace: Workspace) -> None:
    opened = based_on(browser, LEVEL)
    assert put(browser, LEVEL, "0.9").status_code == 303
    refused = browser.post("/settings", data=filled_in(LEVEL, opened, value="0.7"))
    assert refused.status_code == 409
    assert "it is 0.9, set by engineer at 20" in refused.text
    assert "Your change, 0.7, was not saved" in refused.text
    assert level(workspace) == 0.9
    assert put(browser, LEVEL, "0.7").status_code == 303
    with workspace.store() as store:
        assert list_changes(store, limit=1)[0].detail == "from 0.9 to 0.7"


def test_wrong_value_stays_typed(browser: httpx.Client, workspace: Workspace) -> None:
    attempts = "settings.hook_attempts"
    told = filled_in(attempts, "0", value="9") | filled_in(LEVEL, "0", value="minus ten")
    refused = browser.post("/settings", data=told)
    assert refused.status_code == 422
    assert "alert_probability: &#39;minus ten&#39; is not a number." in refused.text
    assert f'name="value.{attempts}" value="9"' in refused.text
    assert f'name="value.{LEVEL}" value="minus ten"' in refused.text
    with workspace.store() as store:
        assert not store.settings.list_current()


def test_unchanged_setting_is_not_set(browser: httpx.Client, workspace: Workspace) -> None:
    other = "hanger.3.thresholds.tension_shift_fraction"
    unchanged = {f"based_on.{other}": "0", f"value.{other}": "0.05", f"was_value.{other}": "0.05"}
    opened = based_on(browser, LEVEL)
    told = {**unchanged, **filled_in(LEVEL, opened, value="0.9")}
    assert browser.post("/settings", data=told).status_code == 303
    with workspace.store() as store:
        assert [row.key for row in store.settings.list_current().values()] == [LEVEL]


def test_test_alert_from_the_page(browser: httpx.Client, workspace: Workspace) -> None:
    told = workspace.folder / "told.json"
    with (workspace.folder / "bridge.toml").open("a") as file:
        file.write(f'\n[[hook]]\nname = "file"\ncommand = ["tee", "{told}"]\n')
        file.write('\n[[hook]]\nname = "broken"\ncommand = ["false"]\n')
    answer = browser.post("/settings/hooks/test", data={"hook": "file"})
    assert "The hook file took the test alert in" in answer.text
    assert "This is a test of the hook file" in told.read_text()
    assert browser.post("/settings/hooks/test", data={"hook": "broken"}).status_code == 409
    with workspace.store() as store:
        tested = [(each.subject, each.detail) for each in list_changes(store, 2)]
    assert tested == [("broken", "it did not arrive"), ("file", "it arrived")]
    assert "hook tested" in browser.get("/audit").text
    assert browser.post("/settings/hooks/test", data={"hook": "none"}).status_code == 404
    with workspace.store() as store:
        assert store.alerts.list_all() == ()


def test_page_says_how_tests_are_judged(browser: httpx.Client, workspace: Workspace) -> None:
    make_baseline(workspace)
    raise_alerts(workspace, [1], [])
    shown = browser.get("/settings?hanger=3").text
    assert "The stored tests are judged with the thresholds shown here." in shown
    put(browser, "hanger.3.thresholds.tension_shift_fraction", "0.06")
    shown = browser.get("/settings?hanger=3").text
    assert "judged again as soon as the daemon runs: tension 0.06 instead of 0.05." in shown
    with workspace.store() as store:
        (watch,) = store.watch.list_all(3)
        store.watch.rerun(3, watch.baseline_id, "another threshold", utc_now())
    assert "Yet to be judged: 1 stored test of it." in browser.get("/settings?hanger=3").text


HOURS = "hook.night.watch.quiet_hours"


@pytest.fixture
def hooked(browser: httpx.Client, workspace: Workspace) -> httpx.Client:
    """Return the bridge with a hook that has quiet hours."""
    with (workspace.folder / "bridge.toml").open("a") as file:
        file.write(
            '\n[[hook]]\nname = "night.watch"\ncommand = ["true"]\nquiet_hours = "22:00-06:00"\n'
        )
    return browser


def put_hours(
    client: httpx.Client, begins: str, ends: str, back: bool = False, opened: str | None = None
) -> httpx.Response:
    opened = based_on(client, HOURS) if opened is None else opened
    told = filled_in(HOURS, opened, back, begins=begins, ends=ends)
    return client.post("/settings", data=told)


def hours(workspace: Workspace) -> str:
    (hook,) = workspace.reopened().bridge.hooks
    return str(hook.quiet_hours or "none")


def test_quiet_hours_set_and_given_back(hooked: httpx.Client, workspace: Workspace) -> None:
    opened, found = based_on(hooked, HOURS), [hours(workspace)]
    shown = hooked.get("/settings").text
    assert f'name="begins.{HOURS}" value="22:00"' in shown
    assert f'name="ends.{HOURS}" value="06:00"' in shown
    for begins, ends, back in (("20:30", "07:00", False), ("", "", False), ("", "", True)):
        assert put_hours(hooked, begins, ends, back).status_code == 303
        found.append(hours(workspace))
        if not begins and not back:
            told = "hook night watch quiet_hours = none instead of what bridge.toml says"
            assert any(told in each.found for each in examine(workspace.folder, utc_now()))
    assert found == ["22:00-06:00", "20:30-07:00", "none", "22:00-06:00"]
    with workspace.store() as store:
        rows = list_changes(store, limit=3)
    assert {(row.who, row.subject) for row in rows} == {("engineer", HOURS.replace(".", " "))}
    assert [row.detail for row in rows] == [
        "from none to 22:00-06:00, back to bridge.toml",
        "from 20:30-07:00 to none",
        "from 22:00-06:00 to 20:30-07:00",
    ]
    put_hours(hooked, "20:30", "07:00")
    late = put_hours(hooked, "", "", opened=opened)
    assert late.status_code == 409
    assert "it is 20:30-07:00, set by engineer" in late.text
    assert "Your change, none, was not saved" in late.text


def test_settings_refuse_as_the_file(hooked: httpx.Client, workspace: Workspace) -> None:
    """And no page changes what runs on the computer."""
    for span in (("22:00", ""), ("", "06:00"), ("24:00", "6"), ("06:00", "06:00")):
        answer = put_hours(hooked, *span)
        assert answer.status_code == 422
        assert "is not a span of the day" in answer.text
        assert "Give two different times" in answer.text
    for key, value, said in (
        (LEVEL, "1.5", "alert_probability must be at least 0.5 and below 1"),
        ("hanger.3.thresholds.tension_shift_fraction", "5", "Give 0.05 for 5 %"),
        (LEVEL, "much", "is not a number"),
        ("hanger.3.limits.tension_max_n", "-1", "is not a positive number"),
        ("settings.false_call_years", "0", "false_call_years"),
    ):
        answer = put(hooked, key, value)
        assert answer.status_code == 422
        assert said in answer.text
    for key in ("hook.mail.command", "settings.store", "hanger.3.length_m", "hanger.77.limits"):
        assert put(hooked, key, "1").status_code == 404
    assert workspace.reopened().bridge.as_in_file is None
    sign_in(hooked, "operator")
    assert put(hooked, LEVEL, "0.9").status_code == 403


def test_engineer_manages_people(browser: httpx.Client, workspace: Workspace) -> None:
    def ask(action: str, name: str, **more: str) -> httpx.Response:
        return browser.post("/users", data={"action": action, "name": name, **more})

    for action in ("remove", "role"):
        refused = ask(action, "engineer", role="reader")
        assert refused.status_code == 409
        assert "the last engineer" in refused.text
    asked = browser.get("/users").text.partition("Remove<span")[2].partition("</details>")[0]
    assert "Yes, remove reader</button>" in asked  # behind a summary to open first
    assert ask("add", "eva", role="engineer", password="short").status_code == 409
    assert ask("add", "eva", role="engineer", password=PASSWORD).status_code == 303
    assert ask("role", "reader", role="operator").status_code == 303
    assert ask("password", "reader", password=PASSWORD + "!").status_code == 303
    assert ask("remove", "operator").status_code == 303
    with workspace.store() as store:
        found = {each.name: each.role for each in store.people.list_all() if not each.removed_at}
        rows = list_changes(store, limit=4)
    assert found == {"reader": "operator", "engineer": "engineer", "eva": "engineer"}
    assert [row.kind for row in rows] == [
        "user removed", "password set", "role changed", "user added",
    ]  # fmt: skip
    assert rows[2].detail == "from reader to operator"
    assert ask("remove", "engineer").status_code == 303
    assert browser.get("/users").status_code == 401
