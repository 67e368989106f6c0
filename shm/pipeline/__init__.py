"""The flow: file -> archive -> modal tests -> posterior -> drift, alert -> hooks.

`intake` takes files in, `steps` holds each arrow as a function of values, `jobs` says which steps
wait, and `flow` begins them, keeps their results and refuses what fails.
"""

from shm.pipeline.flow import Flow, utc_now
from shm.pipeline.intake import Sharing
from shm.pipeline.jobs import Clock, DeliveryRefused, Notifier

__all__ = ["Clock", "DeliveryRefused", "Flow", "Notifier", "Sharing", "utc_now"]
