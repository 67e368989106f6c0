"""What a database's errors mean, what to do, and when trying again may help."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import sqlalchemy as sa

from shm.errors import StoreBusy, StoreDamaged, StoreError


@dataclass(frozen=True)
class Fault:
    """An error by pieces of its message or the beginnings of its SQLSTATE, and what it means.

    A server may speak any language, so a SQLSTATE comes first; while connecting, there is none.
    """

    fragments: tuple[str, ...]
    message: str
    remedy: str
    retry_after_s: float | None
    error: type[StoreError] = StoreError
    states: tuple[str, ...] = ()


_RESTORE = "Restore it from a backup: `shm db restore FILE --replace`."

# Seconds are judgement: what another process holds is free soon, what a person mends takes longer.
FAULTS = (
    Fault(
        ("is locked", "lock timeout", "queuepool limit"),
        "is held by another process",
        "Try again.",
        1.0,
        StoreBusy,
        ("55P03", "40"),
    ),
    Fault(
        ("disk is full", "no space left"),
        "cannot grow: the disk is full",
        "Free some space.",
        60.0,
        states=("53100",),
    ),
    Fault(
        ("readonly", "read-only transaction"),
        "cannot be written",
        "Give this user write access to it.",
        60.0,
        states=("25006", "42501"),
    ),
    Fault(
        ("too many clients", "too many connections", "connection slots"),
        "has no connection free",
        "End other clients of the server, or raise its max_connections.",
        5.0,
        states=("53300",),
    ),
    Fault(
        ("password authentication failed", "no password supplied", "pg_hba.conf"),
        "does not let this user in",
        "Check user and password (SHM_STORE, PGPASSWORD or ~/.pgpass).",
        None,
        states=("28",),
    ),
    Fault(
        ('" does not exist',),
        "is of a user or a database that is not there",
        "Make it with `createuser` or `createdb`, then run `shm db upgrade`.",
        None,
        states=("3D000",),
    ),
    Fault(("disk i/o",), "cannot be read or written", "Check the disk.", 60.0, states=("58030",)),
    Fault(("unable to open",), "cannot be opened", "Check its path and permissions.", None),
    Fault(("not a database",), "is not a database", _RESTORE, 60.0, StoreDamaged),
    Fault(("malformed",), "is damaged", _RESTORE, 60.0, StoreDamaged, states=("XX001", "XX002")),
)

# A server that begins again takes some seconds.
UNREACHABLE = Fault(
    (),
    "cannot be reached",
    "Check that the server runs and that its address is right.",
    5.0,
    states=("08", "57P"),
)


@contextmanager
def translated(location: str, errors: type[Exception] = sa.exc.SQLAlchemyError) -> Iterator[None]:
    """Turns the database's own errors into ours, with remedy and time to wait."""
    try:
        yield
    except UnicodeDecodeError as error:  # SQLite's message quotes a damaged schema
        raise StoreDamaged(
            f"the store {location} is damaged: its schema cannot be read.",
            remedy=_RESTORE,
            retry_after_s=60.0,
        ) from error
    except errors as error:
        cause = " ".join(str(getattr(error, "orig", None) or error).split())
        fault = _meaning(error, cause.lower())
        if fault is None:
            raise StoreError(
                f"the store {location} refused a step: {cause}.", remedy="Run `shm db check`."
            ) from error
        raise fault.error(
            f"the store {location} {fault.message} ({cause}).",
            remedy=fault.remedy,
            retry_after_s=fault.retry_after_s,
        ) from error


def _meaning(error: Exception, cause: str) -> Fault | None:
    state = getattr(getattr(error, "orig", None), "sqlstate", "")
    for fault in (*FAULTS, UNREACHABLE):
        if state.startswith(fault.states) if state else any(f in cause for f in fault.fragments):
            return fault
    # psycopg knows no SQLSTATE of what went wrong with the connection itself.
    lost = isinstance(error, sa.exc.OperationalError) and state is None
    return UNREACHABLE if lost else None
