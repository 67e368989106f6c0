"""The page where engineers set limits, thresholds and when hooks are told, beside `bridge.toml`."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial

from fastapi import APIRouter, Request, Response

from shm.bridge import Bridge
from shm.bridge.changes import HANGER_KEYS, HOOK_KEYS, SETTING_KEYS
from shm.bridge.hooks import QUIET_HOURS, QuietHours
from shm.errors import BadInput, ShmError
from shm.pipeline import utc_now
from shm.pipeline.watching import differences
from shm.report import formatting
from shm.settings import TABLE, Settings, load_settings
from shm.store import Stage
from shm.store.rows import ChangedSetting, value_text
from shm.store.tests import list_waiting_tests
from shm.store.watch import find_latest_watches
from shm.values import Hanger
from shm_daemon.hooks.trial import send_test_alert
from shm_daemon.web.access import AtSite, Engineer
from shm_daemon.web.faults import Refused
from shm_daemon.web.forms import Form, FormOfSettings, redirect_or_show_error
from shm_daemon.web.frame import page
from shm_daemon.web.models import Before
from shm_daemon.web.site import Site

router = APIRouter(include_in_schema=False)

_Value = float | QuietHours | None

_IN = {"": "", "s": " (seconds)"}
_MEANINGS = {
    "thresholds.tension_shift_fraction": "shift of tension that matters (fraction)",
    "thresholds.stiffness_shift_decades": "shift of end stiffness that matters (decades)",
    "thresholds.alert_probability": "probability of such a shift that raises an alert",
    "thresholds.false_call_years": "mean time between false alarms of this hanger (years)",
    "limits.tension_max_n": "upper limit of the tension (N)",
    "limits.tension_min_n": "lower limit of the tension (N)",
    "escalation_after_seconds": "escalate alerts that nobody has acknowledged after (seconds)",
    QUIET_HOURS: "quiet hours, only urgent alerts are sent; in time_zone of bridge.toml, else UTC",
    **{row.name: row.help + _IN.get(row.unit, f" ({row.unit})") for row in TABLE},
}


@dataclass(frozen=True)
class _Row:
    """One value that can be set: its key, what it means, what the file says and what holds."""

    key: str
    label: str
    name: str
    in_file: str
    in_force: str
    changed: ChangedSetting | None

    @property
    def shown(self) -> str:
        """The number as its field shows it, empty where none is set."""
        return "" if self.in_force == value_text(None) else self.in_force

    @property
    def span(self) -> tuple[str, str] | None:
        """The two times of quiet hours, empty where there are none; None for numbers."""
        begins, _, ends = self.in_force.partition("-")
        return ((begins, ends) if ends else ("", "")) if self.name == QUIET_HOURS else None


@router.get("/settings")
def settings_page(request: Request, site: AtSite, _: Engineer, hanger: Before = None) -> Response:
    """Return the bridge's settings and hooks, and the thresholds and limits of one hanger."""
    return _page(request, site, hanger)


@router.post("/settings")
def change(request: Request, site: AtSite, engineer: Engineer, form: FormOfSettings) -> Response:
    """Set the values that differ from those the page showed, or give them back to `bridge.toml`."""
    workspace = site.workspace
    rows = {row.key: row for row in _all_rows(workspace.bridge, workspace.settings)}
    wanted = [key.removeprefix("based_on.") for key in form if key.startswith("based_on.")]
    if unknown := [key for key in wanted if key not in rows]:
        raise Refused(
            404, f"{unknown[0]!r} is none of the settings of this page.", "See bridge.toml."
        )
    hanger = next((int(key.split(".")[1]) for key in wanted if key.startswith("hanger.")), None)
    address = "/settings" if hanger is None else f"/settings?hanger={hanger}#hanger"

    def change() -> None:
        store = site.store.acting_as(engineer.actor)
        try:
            for key, value in _changes(wanted, form).items():
                based_on = form[f"based_on.{key}"]
                workspace.change_setting(
                    store,
                    key,
                    value,
                    utc_now(),
                    engineer.name,
                    based_on=int(based_on) if based_on.isdecimal() else 0,
                    in_file=rows[key].in_file,
                )
        finally:
            site.forget_description()  # ours, or somebody else's change, which it may not show yet

    return redirect_or_show_error(
        change, address, partial(_page, request, site, hanger, typed=form)
    )


@router.post("/settings/hooks/test")
def try_hook(request: Request, site: AtSite, engineer: Engineer, form: Form) -> Response:
    """Send a test alert to one hook, and say what it answered."""
    workspace = site.workspace
    hook = next((each for each in workspace.bridge.hooks if each.name == form.get("hook")), None)
    if hook is None:
        raise Refused(404, "bridge.toml describes no such hook.", "Load the page again.")
    try:
        outcome, status = (
            send_test_alert(workspace, hook, os.environ, utc_now(), engineer.actor).sentence(hook),
            200,
        )
    except ShmError as error:
        outcome, status = f"{error.message} {error.remedy}", 409
    return _page(request, site, None, outcome, status)


def _changes(keys: list[str], form: Mapping[str, str]) -> dict[str, float | str | None]:
    """Return the new values of all settings to change; raises BadInput before any is saved."""
    given_back = {key for key in keys if form.get(f"back.{key}") is not None}
    return {key: _value(key, form) for key in keys if key in given_back or _is_changed(key, form)}


def _is_changed(key: str, form: Mapping[str, str]) -> bool:
    """Return True where a field is not as the page showed it."""
    parts = ("begins", "ends") if key.endswith(QUIET_HOURS) else ("value",)
    return any(form.get(f"{part}.{key}", "") != form.get(f"was_{part}.{key}", "") for part in parts)


def _value(key: str, form: Mapping[str, str]) -> float | str | None:
    """Return a setting's new value, None for its default; `bridge.toml` checks quiet hours."""
    if form.get(f"back.{key}") is not None:
        return None
    if not key.endswith(QUIET_HOURS):
        return _number(key.rpartition(".")[2], form.get(f"value.{key}", ""))
    begins, ends = form.get(f"begins.{key}", ""), form.get(f"ends.{key}", "")
    return f"{begins}-{ends}" if begins or ends else ""


def _number(name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise BadInput(
            f"{name}: {text!r} is not a number.",
            remedy="Write one, with a decimal point. Nothing was saved.",
        )
    return value


def _page(
    request: Request,
    site: Site,
    hanger: int | None,
    message: str = "",
    status: int = 200,
    typed: Mapping[str, str] | None = None,
) -> Response:
    """Show the form; `typed` is what a form held that was refused, to be corrected there."""
    workspace = site.workspace
    bridge, changed = workspace.bridge, site.store.settings.list_current()
    known, judged = [each for each in bridge.watched if each.id == hanger], ""
    groups = [
        ("Bridge", "bridge", list(_of_settings(bridge, workspace.settings, changed))),
        ("Hooks", "hooks", list(_of_hooks(bridge, changed))),
    ]
    for each in known:
        name = formatting.hanger_name(each.id, each.name)
        groups.insert(0, (name, "hanger", list(_of_hanger(bridge, each, changed))))
        judged = _judged(site, each)
    return page(
        request,
        "settings.html.j2",
        status=status,
        message=message,
        is_refused=status >= 400,
        groups=groups,
        hangers=[(h.id, formatting.hanger_name(h.id, h.name)) for h in bridge.watched],
        hanger=hanger,
        judged=judged,
        changed=tuple(changed.values()),
        typed=_to_correct(typed or {}, changed),
        hooks=tuple(each.name for each in bridge.hooks),
    )


def _to_correct(typed: Mapping[str, str], changed: Mapping[str, ChangedSetting]) -> dict[str, str]:
    """Return the fields of a refused form, less those of settings that another person changed."""
    ids = {key: str(each.id) for key, each in changed.items()}
    return {
        field: value
        for field, value in typed.items()
        if typed.get(f"based_on.{field.partition('.')[2]}") == ids.get(field.partition(".")[2], "0")
    }


def _judged(site: Site, hanger: Hanger) -> str:
    """Return a sentence if stored tests of a hanger were judged with other settings."""
    waiting = [each for each in list_waiting_tests(site.store) if each.hanger == hanger.id]
    if any(each.stage is Stage.UPDATED for each in waiting):
        return f"Yet to be judged: {formatting.counted(len(waiting), 'stored test')} of it."
    latest = find_latest_watches(site.store, hangers=[hanger]).get(hanger.id)
    if latest is None:
        return ""
    if others := "; ".join(differences(latest, hanger, site.workspace.settings)):
        return f"The stored tests are judged again as soon as the daemon runs: {others}."
    return "The stored tests are judged with the thresholds shown here."


def _all_rows(bridge: Bridge, settings: Settings) -> Iterator[_Row]:
    yield from _of_settings(bridge, settings, {})
    yield from _of_hooks(bridge, {})
    for each in bridge.watched:
        yield from _of_hanger(bridge, each, {})


def _of_settings(
    bridge: Bridge, settings: Settings, changed: Mapping[str, ChangedSetting]
) -> Iterator[_Row]:
    in_file = load_settings((bridge.as_in_file or bridge).settings_table, source=bridge.source)
    for name in SETTING_KEYS:
        values = getattr(in_file, name), getattr(settings, name)
        yield _row(f"settings.{name}", name, values, changed)


def _of_hooks(bridge: Bridge, changed: Mapping[str, ChangedSetting]) -> Iterator[_Row]:
    for ours, in_file in zip(bridge.hooks, (bridge.as_in_file or bridge).hooks, strict=True):
        for name in HOOK_KEYS:
            values = getattr(in_file, name), getattr(ours, name)
            yield _row(f"hook.{ours.name}.{name}", name, values, changed, f"{ours.name}: ")


def _of_hanger(
    bridge: Bridge, hanger: Hanger, changed: Mapping[str, ChangedSetting]
) -> Iterator[_Row]:
    in_file = (bridge.as_in_file or bridge).tested(hanger.id)
    for key in HANGER_KEYS:
        table, name = key.split(".")
        if table == "limits" and hanger.kind == "any":
            continue  # a structure has no tension
        values = getattr(getattr(in_file, table), name), getattr(getattr(hanger, table), name)
        yield _row(f"hanger.{hanger.id}.{key}", key, values, changed)


def _row(
    key: str,
    name: str,
    values: tuple[_Value, _Value],
    changed: Mapping[str, ChangedSetting],
    before: str = "",
) -> _Row:
    in_file, in_force = (value_text(str(v) if isinstance(v, QuietHours) else v) for v in values)
    label = before + _MEANINGS[name]
    label = label if before else label[0].upper() + label[1:]
    return _Row(key, label, name.rpartition(".")[2], in_file, in_force, changed.get(key))
