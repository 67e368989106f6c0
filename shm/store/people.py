"""Users, roles, passwords and sessions of people; tokens of programs."""

from __future__ import annotations

import hashlib
import hmac
import secrets
import unicodedata
from collections.abc import Collection
from datetime import datetime, timedelta
from functools import cache
from typing import Any

import argon2
import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.errors import NothingThere, UsageError
from shm.store.columns import value_in
from shm.store.database import Repository, insert
from shm.store.journal import note
from shm.store.rows import Role, Scope, StoredToken, User
from shm.store.tables import sessions, tokens, users

SIGNED_IN_FOR = timedelta(days=30)  # judgement: a month; removing the user ends it at once
SESSION = "session_"
"""What the secret of a session begins with; that of a token begins otherwise."""
_SHORTEST, _LONGEST = 15, 1024  # NIST SP 800-63B-4, 3.1.1.2, of a password alone; technical: memory
_LONGEST_NAME = 255  # technical: what a column and a line of a table take
_NO_PASSWORD = ""
"""In place of a password's hash: the user comes by single sign-on alone."""
_SECRET_BYTES = 32  # 256 bits: nobody guesses it
_NOTED_AGAIN_AFTER = timedelta(minutes=1)


class People(Repository):
    """Users, and the sessions of their browsers."""

    def add(self, name: str, role: Role, password: str | None, at: datetime) -> None:
        """Lets a person sign in; raises UsageError where the name is taken or the password poor.

        Who has none (None) comes by single sign-on alone.
        """
        name = _fit(name)
        hashed = _NO_PASSWORD if password is None else _hashed(password)
        values = {"name": name, "role": role, "password_hash": hashed, "made_at": at}
        with self.writing() as connection:
            for taken in _users_named(connection, name):
                raise UsageError(
                    f"there is a user {taken.name} already.",
                    remedy=f"Take another name, or remove it: `shm user remove {taken.name}`.",
                )
            insert(connection, users, values)
            note(connection, at, "user added", f"user {name}", role)

    def remove(self, name: str, at: datetime) -> None:
        """Ends a user and all sessions from now on; raises NothingThere where there is none."""
        self._change(name, at, "user removed", {"removed_at": at})

    def set_single_sign_on(self, name: str, at: datetime) -> None:
        """Replace a password by single sign-on and end all sessions; raise NothingThere."""
        self._change(name, at, "single sign-on set", {"password_hash": _NO_PASSWORD})

    def set_password(self, name: str, password: str, at: datetime) -> None:
        """Give a new password, in place of single sign-on too, and end all sessions.

        Raises NothingThere or UsageError.
        """
        self._change(name, at, "password set", {"password_hash": _hashed(password)})

    def change_password(
        self, name: str, old: str, password: str, at: datetime, secret: str
    ) -> bool:
        """Changes one's own password and ends all sessions but that of `secret`; False where the
        old one is wrong. Raises UsageError.
        """
        if self._whose(name, old) is None:
            return False
        values: dict[str, object] = {"password_hash": _hashed(password)}
        self._change(name, at, "password changed", values, but=secret)
        return True

    def set_role(self, name: str, role: Role, at: datetime) -> None:
        """Changes what a user may and ends all sessions; raises NothingThere or UsageError."""
        self._change(name, at, "role changed", {"role": role})

    def list_all(self) -> tuple[User, ...]:
        """All users, those removed too, as they were made."""
        return tuple(_user(row) for row in self.rows(sa.select(users).order_by(users.c.id)))

    def sign_in(self, name: str, password: str, at: datetime) -> str | None:
        """The secret of a new session; None where name or password is wrong.

        A name that is not there takes as long as a wrong password: the time tells nothing.
        """
        row = self._whose(name, password)
        return None if row is None else self._begin(row.id, at)

    def sign_in_as(self, name: str, at: datetime) -> str | None:
        """Return the secret of a new session of whom a provider of ours names.

        None where no user has exactly this name: a provider may tell names apart that read alike.
        Raises UsageError where the user was made with a password: who holds a name there need not
        be who was given it here.
        """
        row = self.first(_in_force.where(users.c.name == name))
        if row is None or row.name != name:  # a server's collation may take names for equal
            return None
        if row.password_hash != _NO_PASSWORD:
            raise UsageError(
                f"{name} signs in to this bridge with a password, not by single sign-on.",
                remedy="An engineer can change that on the page Users, or with "
                f"`shm user single-sign-on {name}`.",
            )
        return self._begin(row.id, at)

    def user_of(self, secret: str, at: datetime) -> User | None:
        """Return the user of a session; None where it has ended or never was."""
        query = _in_force.join(sessions, sessions.c.user_id == users.c.id).where(
            sessions.c.secret_sha256 == _checksum(secret),
            sessions.c.ended_at.is_(None),
            sessions.c.began_at > at - SIGNED_IN_FOR,
        )
        row = self.first(query)
        return None if row is None else _user(row)

    def sign_out(self, secret: str, at: datetime) -> None:
        """Ends a session where there is one."""
        one = sa.update(sessions).where(sessions.c.secret_sha256 == _checksum(secret))
        with self.writing() as connection:
            connection.execute(one.where(sessions.c.ended_at.is_(None)).values(ended_at=at))

    def _begin(self, user_id: int, at: datetime) -> str:
        secret = SESSION + _secret()
        values = {"user_id": user_id, "secret_sha256": _checksum(secret), "began_at": at}
        with self.writing() as connection:
            insert(connection, sessions, values)
        return secret

    def _whose(self, name: str, password: str) -> sa.Row[Any] | None:
        """The user in force of this name, with this password."""
        with self.reading() as connection:
            row = _named(connection, name)
        try:
            password_hash = _NO_PASSWORD if row is None else row.password_hash
            argon2.PasswordHasher().verify(password_hash or _nobodys(), password[:_LONGEST])
        except argon2.exceptions.VerificationError:
            return None
        return row

    def _change(
        self, name: str, at: datetime, action: str, values: dict[str, object], but: str = ""
    ) -> None:
        """`but` is the secret of the one session that goes on."""
        ends_engineer = "removed_at" in values or values.get("role", "engineer") != Role.ENGINEER
        with self.writing() as connection:
            row = _named(connection, name)
            if row is None:
                raise NothingThere(f"there is no user {name}.", remedy="See `shm user list`.")
            if row.role == Role.ENGINEER and ends_engineer:
                _refuse_last(connection, row.id)
            connection.execute(sa.update(users).where(users.c.id == row.id).values(**values))
            statement = sa.update(sessions).where(
                sessions.c.user_id == row.id, sessions.c.secret_sha256 != _checksum(but)
            )
            connection.execute(statement.where(sessions.c.ended_at.is_(None)).values(ended_at=at))
            detail = f"from {row.role} to {values['role']}" if "role" in values else ""
            note(connection, at, action, f"user {row.name}", detail)


_in_force = sa.select(users).where(users.c.removed_at.is_(None))


def same_name(name: str) -> str:
    """Return a name without Unicode form, spaces and case, in which names that read alike agree."""
    return _in_one_form(name).casefold()


def _in_one_form(name: str) -> str:
    return " ".join(unicodedata.normalize("NFKC", name).split())


def _users_named(connection: Connection, name: str) -> list[sa.Row[Any]]:
    rows = connection.execute(_in_force).all()
    return [row for row in rows if same_name(row.name) == same_name(name)]


def _named(connection: Connection, name: str) -> sa.Row[Any] | None:
    """The user in force who is meant: of names that differ only in form, as older releases took
    them, exactly the one that was written.
    """
    candidates = _users_named(connection, name)
    meant = [row for row in candidates if row.name == name] or candidates
    return meant[0] if len(meant) == 1 else None


def _fit(name: str) -> str:
    """A name in one form; raises UsageError for one that can pass for another."""
    made = _in_one_form(name)
    is_clear = all(unicodedata.category(each)[0] != "C" for each in name.strip())
    if not made or len(made) > _LONGEST_NAME or not is_clear:
        raise UsageError(
            "the name of a user is a short text without invisible characters.",
            remedy="Type the person's name.",
        )
    if same_name(made) == "shm":
        raise UsageError("shm itself writes as shm.", remedy="Type the person's name.")
    return made


def _refuse_last(connection: Connection, id_: int) -> None:
    """Raises UsageError where no other engineer is left: nobody could let anybody in any more."""
    others = _in_force.where(users.c.role == Role.ENGINEER, users.c.id != id_)
    if connection.execute(others).first() is None:
        raise UsageError(
            "this is the last engineer.", remedy="Make another user an engineer before."
        )


def _hashed(password: str) -> str:
    if not _SHORTEST <= len(password) <= _LONGEST:
        raise UsageError(
            f"a password has {_SHORTEST} to {_LONGEST} characters.",
            remedy="Take four or five words that do not belong together.",
        )
    return argon2.PasswordHasher().hash(password)


@cache
def _nobodys() -> str:
    """The hash of a password that nobody has."""
    return argon2.PasswordHasher().hash(_secret())


def _secret() -> str:
    return secrets.token_urlsafe(_SECRET_BYTES)


def _checksum(secret: str) -> str:
    """A secret is 256 random bits: a plain checksum of it cannot be searched for."""
    return hashlib.sha256(secret.encode("utf-8", "surrogatepass")).hexdigest()


class Tokens(Repository):
    """The tokens of programs; a part of the repository of upkeep."""

    def create_token(self, name: str, scope: Scope, at: datetime) -> str:
        """Makes a token and returns its secret, which is told this once and kept nowhere.

        Raises UsageError where a token of that name is in force, or where the name is none.
        """
        if not name.strip() or len(name) > _LONGEST_NAME or not name.isprintable():
            raise UsageError(
                "the name of a token is a short text.", remedy="Name it after who uses it."
            )
        secret = f"shm_{_secret()}"
        scopes = (Scope.READ,) if scope is Scope.READ else (Scope.READ, Scope.WRITE)
        with self.writing() as connection:
            if connection.execute(_valid_tokens.where(tokens.c.name == name)).first() is not None:
                raise UsageError(
                    f"a token named {name} is in force already.",
                    remedy=f"Take another name, or revoke it: `shm token revoke {name}`.",
                )
            values = {"name": name, "token_sha256": _checksum(secret), "created_at": at}
            insert(connection, tokens, {**values, "scopes": scopes})
            note(connection, at, "token made", f"token {name}", f"may {scope}")
        return secret

    def list_tokens(self) -> tuple[StoredToken, ...]:
        """All tokens, those revoked too, as they were made."""
        return tuple(
            value_in(row, StoredToken) for row in self.rows(sa.select(tokens).order_by(tokens.c.id))
        )

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
            note(connection, at, "token revoked", f"token {name}")

    def token_of(self, secret: str, at: datetime) -> StoredToken | None:
        """The token in force with this secret, and a note that it was used; None where none has.

        Every token is compared, in constant time, so that the time taken tells nothing.
        """
        rows = self.rows(_valid_tokens)
        found = _matching(rows, _checksum(secret))
        if found is None:
            return None
        if found.last_used_at is None or at - found.last_used_at >= _NOTED_AGAIN_AFTER:
            with self.writing() as connection:
                noted = sa.update(tokens).where(tokens.c.id == found.id)
                connection.execute(noted.values(last_used_at=at))
        return value_in(found, StoredToken)


_valid_tokens = sa.select(tokens).where(tokens.c.revoked_at.is_(None))


def _matching(rows: Collection[Row[Any]], hashed: str) -> Row[Any] | None:
    found = None
    for row in rows:
        if hmac.compare_digest(row.token_sha256, hashed):
            found = row
    return found


def _user(row: Row[Any]) -> User:
    return value_in(row, User, single_sign_on=row.password_hash == _NO_PASSWORD)
