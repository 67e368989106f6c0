"""The flow: file -> archive -> modal tests -> posterior -> drift, alert -> hooks.

`intake` takes files in, `steps` holds each arrow as a function of values, `jobs` says which steps
wait, and `flow` begins them, keeps their results and refuses what fails.
"""

from typing import TYPE_CHECKING

from shm.pipeline.clock import Clock, utc_now
from shm.resources import when_asked

if TYPE_CHECKING:
    from shm.pipeline.flow import Flow
    from shm.pipeline.intake import Sharing
    from shm.pipeline.jobs import DeliveryRefused, Notifier

__all__ = ["Clock", "DeliveryRefused", "Flow", "Notifier", "Sharing", "utc_now"]

if not TYPE_CHECKING:
    # The flow brings all readers with it: who only asks the time does without.
    __getattr__ = when_asked(
        __name__,
        {
            "DeliveryRefused": "shm.pipeline.jobs",
            "Flow": "shm.pipeline.flow",
            "Notifier": "shm.pipeline.jobs",
            "Sharing": "shm.pipeline.intake",
        },
    )
