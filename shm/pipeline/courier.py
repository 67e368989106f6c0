"""Sends alerts to hooks: messages that are due go out in threads, and again where they failed."""

from __future__ import annotations

import logging
from collections import Counter, defaultdict
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from shm.bridge import Hook
from shm.errors import ShmError, StoreError
from shm.pipeline import Clock
from shm.pipeline.notification_plan import NotificationPolicy, held_messages, message_of, plan
from shm.settings import Settings
from shm.store import Delivery, DeliveryState, Store, Workspace
from shm.values import Alert

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
        due = alerts.list_due_deliveries(now, room, excluded, _LONGEST_WAITS, begun=True)
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
        end = "" if again else "; given up: nobody is told of it by this hook"
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
