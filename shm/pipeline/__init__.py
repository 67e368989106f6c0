"""Run the flow: file -> archive -> modal tests -> posterior -> drift, alert -> hooks.

`intake` takes files in, `steps` holds each arrow as a function of values, `work` says which of them
wait and where results go, `flow` begins them and refuses what fails, `courier` tells hooks.
"""

from collections.abc import Callable
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from shm.resources import when_asked

if TYPE_CHECKING:
    from shm.pipeline.courier import DeliveryRefused, Notifier
    from shm.pipeline.flow import Flow

__all__ = ["Clock", "DeliveryRefused", "Flow", "Notifier", "utc_now"]

Clock = Callable[[], datetime]
"""The time as the flow takes it."""


def utc_now() -> datetime:
    """The time, in UTC."""
    return datetime.now(UTC)


if not TYPE_CHECKING:
    # The flow brings all readers with it: who only asks the time does without.
    of_courier = dict.fromkeys(("DeliveryRefused", "Notifier"), "shm.pipeline.courier")
    __getattr__ = when_asked(__name__, {**of_courier, "Flow": "shm.pipeline.flow"})
