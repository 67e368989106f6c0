"""Verbs on tokens: who may read and write over the network. Only checksums of them are kept."""

from __future__ import annotations

import hashlib
import hmac
import secrets
from collections.abc import Collection
from dataclasses import dataclass
from datetime import datetime, timedelta
from enum import StrEnum
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Row

from shm.errors import NothingThere, UsageError
from shm.store.database import Database, insert
from shm.store.tables import tokens

_SECRET_BYTES = 32
_LONGEST_NAME = 255
_NOTED_AGAIN_AFTER = timedelta(minutes=1)


class Scope(StrEnum):
    """What a token allows; one that may write may read."""

    READ = "read"
    WRITE = "write"


@dataclass(frozen=True)
class StoredToken:
    """A token without its secret."""

    id: int
    name: str
    scopes: frozenset[Scope]
    created_at: datetime
    revoked_at: datetime | None = None
    last_used_at: datetime | None = None


class Tokens(Database):
    """The part of the store that knows who may come in."""

    def create_token(self, name: str, scope: Scope, at: datetime) -> str:
        """Makes a token and returns its secret, which is told this once and kept nowhere.

        Raises UsageError where a token of that name is in force, or where the name is none.
        """
        if not name.strip() or len(name) > _LONGEST_NAME or not name.isprintable():
            raise UsageError(
                "the name of a token is a short text.", remedy="Name it after who uses it."
            )
        secret = f"shm_{secrets.token_urlsafe(_SECRET_BYTES)}"
        scopes = (Scope.READ,) if scope is Scope.READ else (Scope.READ, Scope.WRITE)
        with self.writing() as connection:
            if connection.execute(_in_force.where(tokens.c.name == name)).first() is not None:
                raise UsageError(
                    f"a token named {name} is in force already.",
                    remedy=f"Take another name, or revoke it: `shm token revoke {name}`.",
                )
            values = {"name": name, "token_sha256": _hashed(secret), "created_at": at}
            insert(connection, tokens, {**values, "scopes": ",".join(scopes)})
        return secret

    def tokens(self) -> tuple[StoredToken, ...]:
        """All tokens, those revoked too, as they were made."""
        with self.reading() as connection:
            rows = connection.execute(sa.select(tokens).order_by(tokens.c.id)).all()
        return tuple(_token(row) for row in rows)

    def revoke_token(self, name: str, at: datetime) -> None:
        """Ends a token from now on; raises NothingThere where none of that name is in force."""
        with self.writing() as connection:
            ended = connection.execute(
                sa.update(tokens)
                .where(tokens.c.name == name, tokens.c.revoked_at.is_(None))
                .values(revoked_at=at)
            )
            if ended.rowcount == 0:
                raise NothingThere(
                    f"no token named {name} is in force.", remedy="See `shm token list`."
                )

    def token_of(self, secret: str, at: datetime) -> StoredToken | None:
        """The token in force with this secret, and a note that it was used; None where none has.

        Every token is compared, in constant time, so that the time taken tells nothing.
        """
        with self.reading() as connection:
            rows = connection.execute(_in_force).all()
        found = _matching(rows, _hashed(secret))
        if found is None:
            return None
        if found.last_used_at is None or at - found.last_used_at >= _NOTED_AGAIN_AFTER:
            with self.writing() as connection:
                noted = sa.update(tokens).where(tokens.c.id == found.id)
                connection.execute(noted.values(last_used_at=at))
        return _token(found)


_in_force = sa.select(tokens).where(tokens.c.revoked_at.is_(None))


def _hashed(secret: str) -> str:
    """A secret is 256 random bits: a plain checksum of it cannot be searched for."""
    return hashlib.sha256(secret.encode()).hexdigest()


def _matching(rows: Collection[Row[Any]], hashed: str) -> Row[Any] | None:
    found = None
    for row in rows:
        if hmac.compare_digest(row.token_sha256, hashed):
            found = row
    return found


def _token(row: Row[Any]) -> StoredToken:
    scopes = frozenset(Scope(scope) for scope in row.scopes.split(","))
    return StoredToken(row.id, row.name, scopes, row.created_at, row.revoked_at, row.last_used_at)
