"""Decide which alerts go to which hook now, write the messages, and send them until they arrive.

Nothing is remembered between two looks, so that a kill at any instant changes nothing; what has
been decided is kept by the store (`begin_messages`) before anything is sent.
"""

from __future__ import annotations

import logging
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from functools import cached_property
from typing import Any

from shm.bridge import Hook
from shm.bridge.hooks import escalations_s
from shm.errors import ShmError, StoreError
from shm.pipeline import Clock
from shm.report import formatting
from shm.report.hanger_summary import BASELINE_AND_CHANGE, HangerSummary
from shm.settings import Settings
from shm.store import Delivery, DeliveryState, News, Silence, Store, Workspace
from shm.store.alerts import silenced_until
from shm.values import Alert, Drift, is_ratio, kind_of
from shm.values.rounding import force_unit

_MOST_WINDOWS = 5
"""Judgement: while alike alerts keep coming a message waits for 5 windows, by default the 5 minutes
that Prometheus' Alertmanager leaves between two messages of a group (`group_interval`)."""
_LATEST_ESCALATION_S = 40.0
"""Judgement: an escalation is promised within 60 s; the rest is for the daemon's turn."""
_LISTED = 60  # technical: hangers that a message names; the bridges we know have fewer


@dataclass(frozen=True)
class NotificationPolicy:
    """Policy of messages: the window in which similar alerts are gathered, and the hooks.

    Some are in quiet hours, or receive only what nobody has acknowledged. With `hurry` nothing is
    gathered any longer: who asks is about to end.
    """

    window_s: float = 0.0
    hurry: bool = False
    hooks: Sequence[Hook] = ()

    @cached_property
    def escalation_s(self) -> Mapping[str, float]:
        return escalations_s(self.hooks)


@dataclass(frozen=True)
class Plan:
    """Messages to begin, as the numbers of their deliveries; those that nobody needs, and why."""

    messages: tuple[tuple[int, ...], ...] = ()
    not_needed: Mapping[int, str] = field(default_factory=dict)


def plan(
    unsent: Sequence[Delivery],
    silences: tuple[Silence, ...],
    now: datetime,
    policy: NotificationPolicy,
) -> Plan:
    """Return what to do now with the deliveries whose first attempt has not begun."""
    not_needed: dict[int, str] = {}
    gathered: defaultdict[object, list[tuple[datetime, int]]] = defaultdict(list)
    seen: Counter[object] = Counter()
    for each in unsent:
        if why := _no_need(each, silences, policy):
            not_needed[each.id] = why
            continue
        ready_at = _ready_at(each, silences, now, policy)
        if ready_at is None:
            continue
        group = (each.hook, each.news, *_condition(each.alert)) if policy.window_s else (each.id,)
        # One alert a hanger: a second one is news of its own.
        seen[group, each.alert.hanger] += 1
        gathered[group, seen[group, each.alert.hanger]].append((ready_at, each.id))
    escalated = {each.id for each in unsent if each.hook in policy.escalation_s}
    messages = [
        tuple(sorted(id_ for at, id_ in found if at <= now))
        for found in gathered.values()
        if _is_whole([at for at, _ in found], now, policy, is_late=found[0][1] in escalated)
    ]
    return Plan(tuple(sorted(filter(None, messages))), not_needed)


def _no_need(delivery: Delivery, silences: tuple[Silence, ...], policy: NotificationPolicy) -> str:
    """Return why a hook need not be told that something is raised; empty where it must be."""
    stored = delivery.stored
    if delivery.news is News.RESOLVED:
        return ""
    if stored.resolution is not None:
        return "resolved before it was sent"
    noted = stored.acknowledgement
    if noted is None:
        return ""
    if delivery.hook in policy.escalation_s:
        return f"acknowledged by {noted.who} in time"
    if _held_back_until(delivery, silences, noted.at) is not None:
        return f"acknowledged by {noted.who} while it was silenced"
    if quiet_until(delivery, policy.hooks, noted.at) is not None:
        return f"acknowledged by {noted.who} in the quiet hours"
    return ""


def quiet_until(delivery: Delivery, hooks: Sequence[Hook], at: datetime) -> datetime | None:
    """The end of its hook's quiet hours that a delivery waits for; None where it goes at once."""
    is_raised, message = delivery.news is News.RAISED, delivery.alert.message
    ends = (
        hook.quiet_until(message, at, is_raised=is_raised)
        for hook in hooks
        if hook.name == delivery.hook
    )
    return next(ends, None)


def held_messages(
    waiting: Sequence[Delivery], hooks: Sequence[Hook], now: datetime
) -> frozenset[int]:
    """The numbers of messages that quiet hours hold back: of those with nothing urgent."""
    goes = {each.message_id for each in waiting if quiet_until(each, hooks, now) is None}
    return frozenset(each.message_id for each in waiting if each.message_id) - goes


def _held_back_until(
    delivery: Delivery, silences: tuple[Silence, ...], now: datetime
) -> datetime | None:
    """The end of the latest silence since an alert was raised; None where there was none."""
    stored = delivery.stored
    ends = [
        each.until
        for each in silences
        if each.hanger in (None, stored.alert.hanger)
        and each.starts_at <= now
        and each.until > max(stored.raised_at, each.starts_at)
    ]
    return max(ends, default=None)


def _ready_at(
    delivery: Delivery, silences: tuple[Silence, ...], now: datetime, policy: NotificationPolicy
) -> datetime | None:
    """From when on a hook may be told; None while it is silenced or the time has not come."""
    stored, hanger = delivery.stored, delivery.alert.hanger
    if silenced_until(silences, hanger, now) is not None:
        return None
    resolution = stored.resolution
    since = stored.raised_at
    if delivery.news is News.RESOLVED and resolution is not None:
        since = max(since, resolution.at)
    if since > now:  # the clock was ahead, and is set right: then it is told at once
        return now - _MOST_WINDOWS * timedelta(seconds=policy.window_s)
    ready_at = max(since, _held_back_until(delivery, silences, now) or since)
    if delivery.news is News.RAISED and delivery.hook in policy.escalation_s:
        ready_at = _first_notification(delivery.alert, policy.hooks, ready_at)
        ready_at += timedelta(seconds=policy.escalation_s[delivery.hook])
    if (quiet := quiet_until(delivery, policy.hooks, ready_at)) is not None:
        ready_at = quiet.astimezone(UTC)
    return ready_at if ready_at <= now else None


def _first_notification(alert: Alert, hooks: Sequence[Hook], at: datetime) -> datetime:
    """Return when the first hook that does not escalate is told; quiet hours may put it off."""
    first = (hook for hook in hooks if hook.escalation_after_seconds is None)
    ends = (hook.quiet_until(alert.message, at, is_raised=True) for hook in first)
    return min((each.astimezone(UTC) if each else at for each in ends), default=at)


def _is_whole(
    times: Sequence[datetime], now: datetime, policy: NotificationPolicy, *, is_late: bool
) -> bool:
    """Return True if alike alerts wait for no further one; those of an escalation wait for less."""
    if policy.hurry or not policy.window_s:
        return True
    window = timedelta(seconds=policy.window_s)
    latest = min(times) + _MOST_WINDOWS * window
    if is_late:
        latest = min(latest, min(times) + timedelta(seconds=_LATEST_ESCALATION_S))
    return now >= min(max(times) + window, latest)


def _condition(alert: Alert) -> tuple[object, ...]:
    """Return what similar alerts have in common: rules, and the leading quantity and its sign."""
    if not alert.drifts:
        return (alert.kinds,)
    lead = alert.drifts[0]
    return (alert.kinds, kind_of(lead.quantity), lead.shift_mean < 0)


# ---------------------------------------------------------------- what a message says


def message_of(deliveries: Sequence[Delivery]) -> Alert:
    """Return what a hook is told by the deliveries of one message, the first of them first.

    Its key is that of the only alert, else of the first with the number of the others: the same at
    each attempt, since a message keeps its deliveries.
    """
    messages = tuple(_message(each) for each in deliveries)
    if len(messages) == 1:
        return messages[0]
    first, suffix = messages[0], ":resolved" if deliveries[0].news is News.RESOLVED else ""
    key = f"{first.key.removesuffix(suffix)}:and-{len(messages) - 1}-more{suffix}"
    return replace(first, key=key, message=_of_several(deliveries), drifts=(), change=None,
                   tension=None, alerts=messages)  # fmt: skip


def _message(delivery: Delivery) -> Alert:
    alert, ended = delivery.alert, delivery.stored.resolution
    if delivery.news is News.RAISED or ended is None:
        return alert
    return replace(
        alert,
        key=f"{alert.key}:resolved",
        kinds=("resolved",),
        message=f"Hanger {alert.hanger}: alert {delivery.stored.id} is resolved. No action is "
        f"needed. {_by(ended.who, ended.why)} The alert said: {alert.message}",
    )


def _by(who: str, why: str) -> str:
    why = why.rstrip(".")
    return f"{why[:1].upper()}{why[1:]}." if who == "shm" else f"{who}: {why}."


def _of_several(deliveries: Sequence[Delivery]) -> str:
    """State, action, why; all hangers by their numbers, the largest shift with its hanger."""
    alerts = sorted((each.alert for each in deliveries), key=lambda alert: alert.hanger)
    named = ", ".join(str(alert.hanger) for alert in alerts[:_LISTED])
    if len(alerts) > _LISTED:
        named += f" and {len(alerts) - _LISTED} more"
    if deliveries[0].news is News.RESOLVED:
        reasons = Counter(_by(e.who, e.why) for d in deliveries if (e := d.stored.resolution))
        why = reasons.most_common(1)[0][0]
        return f"{len(alerts)} hangers: resolved: {named}. No action is needed. {why}"
    leads = [alert.drifts[0] for alert in alerts if alert.drifts]
    if not leads:
        kinds = " and ".join(alerts[0].kinds) or "alert"
        if "held" in alerts[0].kinds:
            return (
                f"{len(alerts)} hangers: tests are held until you decide: {named}. Decide on each "
                f"within a week: `shm ingest --held`. One of them: {alerts[0].message}"
            )
        return f"{len(alerts)} hangers: {kinds}: {named}. {alerts[0].message}"
    largest = max(leads, key=lambda drift: abs(drift.shift_mean))
    name, way = kind_of(largest.quantity).noun, "fell" if largest.shift_mean < 0 else "rose"
    # As urgent as each alert by itself: a loss beyond its threshold is for today.
    is_loss = "beyond threshold" in alerts[0].kinds and largest.shift_mean < 0
    soon = "today" if is_loss else "within a week"
    return (
        f"{len(alerts)} hangers: {name} {way}: {named}; largest {_amount(largest)} at hanger "
        f"{largest.hanger}. Repeat the test of that hanger {soon}, and ask what all have in "
        f"common: load, temperature, works, a sensor. See `shm alerts` for each. "
        f"{_message_of(alerts, largest.hanger)}"
    )


def _message_of(alerts: Sequence[Alert], hanger: int) -> str:
    return next(alert.message for alert in alerts if alert.hanger == hanger)


def _amount(lead: Drift) -> str:
    if is_ratio(lead.quantity):
        return f"{100 * abs(lead.shift_mean):.1f} %"
    return f"{10 ** abs(lead.shift_mean):.1f} times"


def with_tension(alert: Alert, now: HangerSummary) -> Alert:
    """Return an alert with the tension of its hanger, as every face states it."""
    alert = replace(alert, tension=now.tension)
    then_n, now_n = now.baseline_n, now.tension_n
    if then_n is None or now_n is None or not now.is_found or now.basis != BASELINE_AND_CHANGE:
        return alert
    unit = force_unit(then_n.mean, now_n.mean)
    sentences, mark, details = alert.message.partition(" Details: ")
    sentences += f" The tension is now {formatting.with_half(now_n, unit)}."
    sentences += f" At the baseline it was {formatting.with_half(then_n, unit)}."
    return replace(alert, message=f"{sentences}{mark}{details}")


# ---------------------------------------------------------------- after planned works


def works_before(
    alert: Alert, windows: Sequence[Silence], earlier: Sequence[Alert]
) -> Silence | None:
    """The maintenance window that an alert is the first to come after; None where there is none.

    Not where the change is known to have begun later, or another alert came in between; that a
    test was to be repeated is none.
    """
    ended = [
        each
        for each in windows
        if each.is_maintenance
        and each.until > each.starts_at
        and each.hanger in (None, alert.hanger)
        and each.until <= alert.time
    ]
    if not ended:
        return None
    latest = max(ended, key=lambda each: each.until)
    if alert.change is not None and alert.change.began_after >= latest.until:
        return None
    announced = [each for each in earlier if each.kinds != ("repeat the test",)]
    if any(each.time >= latest.until and each.key != alert.key for each in announced):
        return None
    return latest


def after_works(alert: Alert, works: Silence) -> Alert:
    """The same alert, which says that works lie in between and how to accept what they changed."""
    text = (
        f"Planned works lie in between ({works.why.rstrip('.')}), until {works.until:%Y-%m-%d}. If "
        f"they explain it, accept the new state: `shm drift rebaseline --hanger {alert.hanger} "
        f"--since {works.until:%Y-%m-%d}`."
    )
    return replace(alert, message=f"{alert.message} {text}")


_THREADS = 16  # technical: they mostly wait for an answer
_THREADS_A_HOOK = 4  # technical: a quarter, so that a hook that hangs leaves room for three
_LONGEST_S = 86400.0  # judgement: a hook mended within a day is told the day after at the latest
_LONGEST_WAITS = (timedelta(0), timedelta(seconds=_LONGEST_S))
"""Before the first attempt and after a failure: who is put off for longer, was by a wrong clock."""

Notifier = Callable[[Hook, Alert], object]

log = logging.getLogger(__name__)


class DeliveryRefused(ShmError):
    """A hook has said for good that it does not take an alert: no use in trying again."""


@dataclass(frozen=True)
class _Sending:
    """A message under way to a hook."""

    delivery: Delivery
    message: Alert
    future: Future[Any]

    @property
    def log_fields(self) -> dict[str, object]:
        return {**alert_fields(self.message), "hook": self.delivery.hook, "stage": "deliver"}


class Courier:
    """Sends what the outbox of a store owes to hooks; without a notifier it waits there."""

    def __init__(
        self, store: Store, notifier: Notifier | None, clock: Clock, wake: Callable[[], object]
    ):
        self._store, self._notifier, self._clock, self._wake = store, notifier, clock, wake
        self._threads = ThreadPoolExecutor(_THREADS, thread_name_prefix="hook")
        self._sending: list[_Sending] = []

    def close(self) -> None:
        """Abandon what is under way; the outbox still says that it is owed."""
        self._threads.shutdown(wait=False, cancel_futures=True)

    @property
    def under_way(self) -> list[Future[Any]]:
        """Return what is being sent."""
        return [each.future for each in self._sending]

    def store_outcomes(self, settings: Settings) -> None:
        """Store how deliveries went that have ended.

        Raises StoreError where the store cannot be used now: they are stored at a later turn.
        """
        for sent in [each for each in self._sending if each.future.done()]:
            self._store_outcome(sent, settings)
            self._sending.remove(sent)

    def begin(self, workspace: Workspace, *, hurry: bool) -> None:
        """Group alerts into messages, with `hurry` at once, and send those that are due."""
        if self._notifier is None:
            return
        self._begin_messages(workspace, hurry)
        hooks = {hook.name: hook for hook in workspace.bridge.hooks}
        for delivery, message in self._list_due(workspace):
            hook = hooks.get(delivery.hook)
            future = self._threads.submit(_send, self._notifier, hook, delivery.hook, message)
            self._sending.append(_Sending(delivery, message, future))
            future.add_done_callback(lambda _: self._wake())

    def _begin_messages(self, workspace: Workspace, hurry: bool) -> None:
        """Decide which alerts go to which hook now, as one message or alone, and store that."""
        unsent = self._store.alerts.list_deliveries(DeliveryState.WAITING, unsent=True)
        if not unsent:
            return
        window_s, now = workspace.settings.alert_grouping_seconds, self._clock()
        policy = NotificationPolicy(window_s, hurry, workspace.bridge.hooks)
        made = plan(unsent, self._store.silences.list_all(), now, policy)
        self._store.alerts.begin_messages(made.messages, made.not_needed, now)

    def _list_due(self, workspace: Workspace) -> list[tuple[Delivery, Alert]]:
        """Return as many as there is room for; a hook that hangs takes no more than its part."""
        taken = Counter(each.delivery.hook for each in self._sending)
        if taken.total() >= _THREADS:
            return []
        now, alerts = self._clock(), self._store.alerts
        excluded = [each.delivery.id for each in self._sending]
        excluded += self._list_quiet(workspace, now)
        room = 2 * _THREADS
        due = alerts.list_due_deliveries(now, room, excluded, _LONGEST_WAITS)
        parts: defaultdict[int | None, list[Delivery]] = defaultdict(list)
        for part in alerts.list_deliveries(messages=[each.id for each in due]) if due else ():
            parts[part.message_id].append(part)
        found = []
        for delivery in due:
            if taken[delivery.hook] < _THREADS_A_HOOK and taken.total() < _THREADS:
                taken[delivery.hook] += 1
                found.append((delivery, message_of(parts[delivery.id])))
        return found

    def _list_quiet(self, workspace: Workspace, now: datetime) -> frozenset[int]:
        """Return messages that wait for the end of quiet hours, that of a failed attempt too."""
        hooks = workspace.bridge.hooks
        if not any(hook.quiet_hours and hook.quiet_hours.until(now) for hook in hooks):
            return frozenset()
        waiting = self._store.alerts.list_deliveries(DeliveryState.WAITING)
        return held_messages(waiting, hooks, now)

    def _store_outcome(self, sent: _Sending, settings: Settings) -> None:
        error = sent.future.exception()
        try:
            if error is None:
                self._store.alerts.save_delivery(sent.delivery, self._clock())
                log.info("deliver %d: done", sent.delivery.id, extra=sent.log_fields)
                return
        except Exception as fault:
            if isinstance(fault, StoreError) and fault.retry_after_s is not None:
                raise
            error = fault
        self._put_off(sent, error, settings)

    def _put_off(self, sent: _Sending, error: BaseException, settings: Settings) -> None:
        """Try a failed delivery ever later, until it has failed too often or was refused."""
        delivery, now = sent.delivery, self._clock()
        attempts = delivery.attempts + 1
        again = not isinstance(error, DeliveryRefused) and attempts < settings.hook_attempts
        next_attempt_at = now + _wait_after(attempts, settings) if again else None
        self._store.alerts.save_failure(delivery, str(error), now, next_attempt_at)
        end = "" if again else "; given up: this hook does not deliver it"
        text = "hook %s failed on %s: %s%s"
        log.warning(text, delivery.hook, sent.message.key, error, end, extra=sent.log_fields)


def alert_fields(alert: Alert) -> dict[str, object]:
    """Return the fields by which an alert is searched for in the log."""
    return {"alert": alert.key, "hanger": alert.hanger, "test": alert.test}


def _wait_after(attempts: int, settings: Settings) -> timedelta:
    """Return the wait after so many failures: doubled each time, a day at most."""
    seconds = settings.hook_backoff_seconds * 2.0 ** (attempts - 1)
    return timedelta(seconds=min(seconds, _LONGEST_S))


def _send(notifier: Notifier, hook: Hook | None, name: str, message: Alert) -> None:
    if hook is None:
        raise ShmError(f"no hook {name} in bridge.toml.", remedy="Describe it again.")
    notifier(hook, message)
