"""Whether all is well with a workspace, and what to do where it is not."""

from shm_daemon.doctor.checks import Finding, Level
from shm_daemon.doctor.examining import examine

__all__ = ["Finding", "Level", "examine"]
