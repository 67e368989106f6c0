"""Where a store is: a SQLite file or the URL of a PostgreSQL database, told without password."""

from __future__ import annotations

from pathlib import Path

import sqlalchemy as sa

from shm.errors import StoreError

_FORM = "postgresql://USER@HOST:5432/DATABASE"


def url_of(location: str | Path) -> sa.URL:
    """The address of a store given as a file or a URL.

    Raises StoreError, which never repeats the URL: it may hold a password.
    """
    text = str(location)
    if "://" not in text:
        return sa.URL.create("sqlite", database=text)
    try:
        url = sa.make_url(text)
    except (sa.exc.ArgumentError, ValueError):
        raise _unreadable() from None
    kind = url.get_backend_name()
    if kind == "sqlite":
        return url
    if kind not in ("postgresql", "postgres"):
        raise StoreError(
            f"no driver for a store of kind {kind}.", remedy=f"Use a file name, or {_FORM}."
        )
    if "@" in (url.host or "") or not url.database:
        raise _unreadable()
    return url.set(drivername="postgresql+psycopg")


def is_server(location: str | Path) -> bool:
    """Whether the store is a PostgreSQL database rather than a file."""
    return url_of(location).get_backend_name() == "postgresql"


def has_password(location: str) -> bool:
    """Whether the URL itself holds a password, which then stands wherever the URL stands."""
    url = url_of(location)
    return bool(url.password) or "password" in url.query


def shown(url: sa.URL) -> str:
    """An address as it may be told to anybody: without password and options."""
    name = url.get_backend_name()
    return url.set(drivername=name, query={}).render_as_string(hide_password=True)


def _unreadable() -> StoreError:
    return StoreError(
        "the store's URL cannot be read.",
        remedy=f"Write {_FORM}; in a password, write @ as %40, / as %2F and : as %3A.",
    )
