"""The flow: file -> archive -> modal tests -> posterior -> drift, alert -> hooks.

`intake` takes files in, `steps` holds each arrow as a function of values, `jobs` says which steps
wait, and `flow` begins them, keeps their results and refuses what fails.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from shm.pipeline.clock import Clock, utc_now

if TYPE_CHECKING:
    from shm.pipeline.flow import Flow
    from shm.pipeline.intake import Sharing
    from shm.pipeline.jobs import DeliveryRefused, Notifier

__all__ = ["Clock", "DeliveryRefused", "Flow", "Notifier", "Sharing", "utc_now"]

_HOME = {"DeliveryRefused": "jobs", "Flow": "flow", "Notifier": "jobs", "Sharing": "intake"}

if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        """The flow brings all readers with it: who only asks the time does without."""
        if name not in _HOME:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(f"shm.pipeline.{_HOME[name]}"), name)
