"""The `[[hook]]` tables of `bridge.toml`: how people are told of alerts. Secrets never stand here.

A kind of hook is known by the key that only it has (`_KINDS`); what delivers it is in the daemon.

The quiet hours of a hook: from when to when it is told only of what is urgent.
"""

from __future__ import annotations

import re
import string
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, time, timedelta, tzinfo
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from shm.bridge.table import Table, web_address
from shm.errors import BadInput
from shm.values.messages import Lead

QUIET_HOURS = "quiet_hours"
_TIME = r"((?:[01][0-9]|2[0-3]):[0-5][0-9])"
_SPAN = re.compile(f"{_TIME}-{_TIME}")


@dataclass(frozen=True)
class QuietHours:
    """Each day's span, over midnight where it ends no later than it begins, by the clocks there.

    A time that the change to summer time leaves out, or that comes twice in autumn, is read as
    calendars read it (RFC 5545, 3.3.5): by the clock before the gap, and as the first of the two.
    """

    begins: time
    ends: time
    zone: tzinfo

    def __str__(self) -> str:
        return f"{self.begins:%H:%M}-{self.ends:%H:%M}"

    def until(self, at: datetime) -> datetime | None:
        """Return the end of the quiet hours around a moment by local time; None if in none."""
        today = at.astimezone(self.zone).date()
        for day in (today - timedelta(days=1), today):
            last_day = day if self.begins < self.ends else day + timedelta(days=1)
            # In UTC: times of one zone are compared by their clock faces, even where clocks change.
            begins = datetime.combine(day, self.begins, self.zone).astimezone(UTC)
            ends = datetime.combine(last_day, self.ends, self.zone).astimezone(UTC)
            if begins <= at < ends:
                return ends.astimezone(self.zone)
        return None


def quiet_hours_of(table: Table, zone: tzinfo) -> QuietHours | None:
    """Return the quiet hours of a `[[hook]]` table, None if it states none; raises BadInput."""
    if QUIET_HOURS not in table:
        return None
    text = table.values[QUIET_HOURS]
    found = _SPAN.fullmatch(text) if isinstance(text, str) else None
    if found is None or found[1] == found[2]:
        raise table.refusal(
            f"{QUIET_HOURS} = {text!r} is not a span of the day",
            f'Give two different times: {QUIET_HOURS} = "22:00-06:00".',
        )
    begins, ends = map(time.fromisoformat, found.groups())
    return QuietHours(begins, ends, zone)


def zone_of(values: dict[str, Any], path: Path) -> tzinfo:
    """Return the time zone of `[bridge]`, else UTC; raises BadInput for one that nobody knows."""
    name = values.get("time_zone", "UTC")
    if name == "UTC":
        return UTC  # known where the computer has no table of zones, too
    try:
        return ZoneInfo(name)
    except (ZoneInfoNotFoundError, ValueError, TypeError, OSError):
        raise BadInput(
            f"bridge: time_zone = {name!r} is no time zone that this computer knows.",
            file=path,
            remedy='Write time_zone = "Europe/Berlin", or leave it out for UTC.',
        ) from None


_ESCALATION = "escalation_after_seconds"
_OF_ALL = ("name", _ESCALATION, QUIET_HOURS)
_LONGEST_ESCALATION_S = 366 * 86400.0  # judgement: what nobody saw for a year, nobody will
_ADDRESS = 'Write url = "https://host/path".'
_WHERE_SECRETS_STAND = (
    'Write it into a file that only you can read and name it: secret_file = "webhook.secret"; or '
    'name a variable of the environment: secret_env = "NAME".'
)
_ADDRESS_CHARACTERS = frozenset(string.digits + string.ascii_letters + string.punctuation)

# Services that carry a message away over a network. What acts on this machine (syslog, dbus,
# desktop windows), moves files or only displays something on a screen is left out.
_SERVICES = """
    mailto mailtos ses sendgrid mailgun mailersend smtp2go sparkpost postmark brevo resend o365
    json jsons form forms xml xmls apprise apprises
    slack workflow workflows mmost mmosts rocket rockets matrix matrixs discord zulip gchat
    webex wxteams ryver flock twist zoom ringc nctalk nctalks synology synologys
    feishu lark dingtalk wecombot wechat line guilded groupme kook cliq zohocliq
    tgram signal signals whatsapp threema viber
    gotify gotifys ntfy ntfys pover pbul prowl bark barks pushy push simplepush spush
    pagerduty opsgenie pagertree signl4 splunk victorops squadcast spike goalert goalerts ilert
    betterstack firehydrant incidentio xmatters lfg
    twilio vonage nexmo plivo sinch msgbird clicksend clickatell bulksms infobip seven sns telnyx
    voipms d7sms 46elks elks atalk smseagle smseagles httpsms serwersms freemobile
"""
APPRISE_SCHEMES = frozenset(_SERVICES.split())


@dataclass(frozen=True)
class Hook:
    """Something that is told of each alert.

    With `escalation_after_seconds` it is told only of those that nobody has acknowledged so long
    after they were raised. In its `quiet_hours` it is told only of what is urgent.
    """

    name: str
    escalation_after_seconds: float | None = field(default=None, kw_only=True)
    quiet_hours: QuietHours | None = field(default=None, kw_only=True)

    def quiet_until(self, message: str, at: datetime, *, is_raised: bool) -> datetime | None:
        """Return the end of the quiet hours that a message waits for; None where it goes at once.

        What must be done today and an escalation wait for nothing; that they are over does.
        """
        escalates = self.escalation_after_seconds is not None
        if self.quiet_hours is None:
            return None
        if is_raised and (escalates or Lead.of(message).urgency == "today"):
            return None
        return self.quiet_hours.until(at)

    @property
    def kind(self) -> str:
        """The name of the kind of hook."""
        return type(self).__name__.removesuffix("Hook").lower()


@dataclass(frozen=True)
class CommandHook(Hook):
    """A program run for each alert, which it gets as JSON on standard input; no shell."""

    command: tuple[str, ...]


@dataclass(frozen=True, repr=False)
class WebhookHook(Hook):
    """An address to which each alert is posted as JSON, signed with a secret that both ends know.

    The secret stands in the file `secret_file`, taken from the workspace's folder on, or in the
    variable `secret_env` of the daemon's environment; the other one is empty.
    """

    url: str
    secret_file: str = ""
    secret_env: str = ""

    @property
    def host(self) -> str:
        """The machine that is told: all of the address that may be shown, the rest may be a key."""
        return urlsplit(self.url).hostname or ""


@dataclass(frozen=True, repr=False)
class AppriseHook(Hook):
    """Addresses in the notation of the library apprise, or a file of them, one a line."""

    addresses: tuple[str, ...] = ()
    address_file: str = ""


def escalations_s(hooks: Iterable[Hook]) -> dict[str, float]:
    """Return the hooks that are told only of what nobody has acknowledged after so many seconds."""
    return {
        hook.name: hook.escalation_after_seconds
        for hook in hooks
        if hook.escalation_after_seconds is not None
    }


def hook_of(values: Mapping[str, Any], path: Path, zone: tzinfo) -> Hook:
    """Return the hook of one `[[hook]]` table, for a bridge in a time zone.

    Raises BadInput naming the hook and what to write.
    """
    name = values.get("name")
    if not isinstance(name, str) or not name.strip() or not name.isprintable():
        raise BadInput("a [[hook]] has no name.", file=path, remedy='Write name = "mail".')
    table = Table(values, f"hook {name}", path)
    readers = {_KINDS[key] for key in _KINDS if key in table}
    if len(readers) != 1:
        raise table.refusal(
            f"it needs exactly one of {', '.join(_KINDS)}",
            'Write command = ["/path/to/program", "argument"] or url = "https://host/path".',
        )
    seconds, quiet = _escalation_after_seconds(table), quiet_hours_of(table, zone)
    hook = readers.pop()(table, name)
    return replace(hook, escalation_after_seconds=seconds, quiet_hours=quiet)


def _escalation_after_seconds(table: Table) -> float | None:
    seconds = table.values.get(_ESCALATION)
    if seconds is None:
        return None
    is_number = isinstance(seconds, int | float) and not isinstance(seconds, bool)
    if not is_number or not 1 <= seconds <= _LONGEST_ESCALATION_S:
        raise table.refusal(
            f"{_ESCALATION} is not a number of seconds from 1 to a year",
            f"Write {_ESCALATION} = 3600.",
        )
    return float(seconds)


def apprise_scheme(address: str) -> str:
    """Return the scheme of an address of apprise; raises ValueError where alerts do not go by it.

    The message names the scheme alone: the rest of an address may hold a password.
    """
    scheme, separator, rest = address.partition("://")
    scheme = scheme.lower()
    if not separator or not rest or not _ADDRESS_CHARACTERS.issuperset(address):
        raise ValueError("an address is not of the form scheme://...")
    if scheme not in APPRISE_SCHEMES:
        raise ValueError(f"alerts do not go by {scheme[:20]}://")
    return scheme


def _command(table: Table, name: str) -> Hook:
    table.refuse_unknown((*_OF_ALL, "command"))
    return CommandHook(name, _texts(table, "command", '["/path/to/program", "argument"]'))


def _webhook(table: Table, name: str) -> Hook:
    if "secret" in table:
        raise table.refusal("bridge.toml is no place for a secret", _WHERE_SECRETS_STAND)
    table.refuse_unknown((*_OF_ALL, "url", "secret_file", "secret_env", "allow_http"))
    if ("secret_file" in table) == ("secret_env" in table):
        raise table.refusal("it needs a secret to sign with, in one place", _WHERE_SECRETS_STAND)
    in_file, in_environment = (
        _text(table, key, _WHERE_SECRETS_STAND) for key in ("secret_file", "secret_env")
    )
    url = web_address(table, "url", _ADDRESS, "alerts are signed instead")
    return WebhookHook(name, url, in_file, in_environment)


def _apprise(table: Table, name: str) -> Hook:
    table.refuse_unknown((*_OF_ALL, "apprise", "apprise_file"))
    if "apprise_file" in table and "apprise" not in table:
        return AppriseHook(name, address_file=_text(table, "apprise_file", "Name a file."))
    if "apprise_file" in table:
        raise table.refusal("it has both apprise and apprise_file", "Keep one of them.")
    addresses = _texts(table, "apprise", '["mailto://..."], or better apprise_file = "path"')
    for address in addresses:
        try:
            apprise_scheme(address)
        except ValueError as error:
            raise table.refusal(str(error), "See docs/alerts.md for those that do.") from None
    return AppriseHook(name, addresses)


_KINDS: dict[str, Callable[[Table, str], Hook]] = {
    "command": _command,
    "url": _webhook,
    "apprise": _apprise,
    "apprise_file": _apprise,
}


def _text(table: Table, key: str, remedy: str) -> str:
    """Return a text of the table, empty where the key is missing."""
    value = table.values.get(key, "")
    if key in table and (not isinstance(value, str) or not value.strip()):
        raise table.refusal(f"{key} is not a text", remedy)
    return str(value)


def _texts(table: Table, key: str, example: str) -> tuple[str, ...]:
    value = table.values[key]
    if not isinstance(value, list) or not value or not all(isinstance(v, str) for v in value):
        raise table.refusal(f"{key} is not a list of texts", f"Write {key} = {example}.")
    return tuple(value)
