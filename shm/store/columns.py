"""Column types that hold our values in SQLite and PostgreSQL, and tables made of dataclasses."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import asdict, fields, is_dataclass, replace
from datetime import UTC, datetime
from enum import StrEnum
from functools import cache, lru_cache
from types import NoneType, UnionType
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Dialect, Row

from shm.documents import dump, value_of
from shm.errors import StoreDamaged
from shm.store.database import insert
from shm.values import NAN


class Number(sa.types.TypeDecorator[float]):
    """A float whose unknown value is NaN in memory and NULL in the table."""

    impl = sa.Double
    cache_ok = True
    may_be_null = True

    def process_bind_param(self, value: float | None, dialect: Dialect) -> float | None:
        return None if value is None or math.isnan(value) else float(value)

    def process_result_value(self, value: float | None, dialect: Dialect) -> float:
        return NAN if value is None else value


class UtcTime(sa.types.TypeDecorator[datetime]):
    """A timezone-aware UTC time; SQLite, which knows no zones, keeps it without."""

    impl = sa.DateTime(timezone=True)
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        return None if value is None else value.astimezone(UTC)

    def process_result_value(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        if value is None:
            return None
        return value.astimezone(UTC) if value.tzinfo else value.replace(tzinfo=UTC)


class Document(sa.types.TypeDecorator[Any]):
    """A JSON document as text, as which it comes back; NaN is null, times are ISO texts."""

    impl = sa.Text
    cache_ok = True

    def process_bind_param(self, value: Any, dialect: Dialect) -> str | None:
        return None if value is None else dump(value)


class Json(Document):
    """A value of some kind as a JSON document, back by the types that its class declares.

    `absent` stands for a document that is not there; those that are `cached` are immutable values
    that are read again and again.
    """

    cache_ok = True

    def __init__(self, kind: Any, *, absent: Any = None, cached: bool = False):
        super().__init__()
        self.kind, self.absent, self.cached = kind, absent, cached
        self.may_be_null = absent is not None

    def process_bind_param(self, value: Any, dialect: Dialect) -> str | None:
        return super().process_bind_param(_plain(value), dialect)

    def process_result_value(self, value: str | None, dialect: Dialect) -> Any:
        if value is None:
            return self.absent
        return (value_from if self.cached else _value)(self.kind, value)


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_plain(each) for each in value]
    return asdict(value) if is_dataclass(value) and not isinstance(value, type) else value


def _value(kind: Any, text: str) -> Any:
    return value_of(kind, loads(text))


# technical: what is shown again, some kilobytes each
value_from: Callable[[Any, str], Any] = lru_cache(1024)(_value)
"""Return an immutable value of a kind from the text of its document."""


class Name(sa.types.TypeDecorator[Any]):
    """A member of an enumeration by its value; a name of a newer version stays a text."""

    impl = sa.String
    cache_ok = True

    def __init__(self, kind: type[StrEnum], length: int = 16):
        super().__init__(length)
        self.kind, self._names = kind, frozenset(map(str, kind))

    def process_bind_param(self, value: Any, dialect: Dialect) -> str | None:
        return None if value is None else str(value)

    def process_result_value(self, value: str | None, dialect: Dialect) -> Any:
        return self.kind(value) if value in self._names else value


class Names(Name):
    """Several members of an enumeration, separated by commas."""

    cache_ok = True

    def process_bind_param(self, value: Any, dialect: Dialect) -> str | None:
        return value if isinstance(value, str | None) else ",".join(sorted(value))

    def process_result_value(self, value: str | None, dialect: Dialect) -> Any:
        return None if value is None else frozenset(map(self.kind, value.split(",")))


class Blank(sa.types.TypeDecorator[str]):
    """A text that is empty in memory and NULL in the table where there is none."""

    impl = sa.Text
    cache_ok = True
    may_be_null = True

    def process_bind_param(self, value: str | None, dialect: Dialect) -> str | None:
        return value or None

    def process_result_value(self, value: str | None, dialect: Dialect) -> str:
        return value or ""


def loads(text: Any) -> Any:
    """Return a document from its text, None where there is none; raise StoreDamaged of no JSON."""
    try:
        return None if text is None else json.loads(text)
    except ValueError as error:
        raise StoreDamaged(
            f"a document of the store cannot be read: {error}.",
            remedy="Restore it from a backup: `shm db restore FILE --replace`.",
            retry_after_s=60.0,
        ) from error


metadata = sa.MetaData(
    naming_convention={
        "ix": "ix_%(table_name)s_%(column_0_N_name)s",
        "uq": "uq_%(table_name)s_%(column_0_N_name)s",
        "fk": "fk_%(table_name)s_%(column_0_name)s",
        "pk": "pk_%(table_name)s",
    }
)


def identity() -> sa.Column[int]:
    """The number of a row."""
    return sa.Column("id", sa.Integer, primary_key=True)


def reference(table: str, *, nullable: bool = False) -> sa.Column[int]:
    """The number of a row of another table."""
    return sa.Column(f"{table[:-1]}_id", sa.ForeignKey(f"{table}.id"), nullable=nullable)


def note_on_alert(prefix: str) -> tuple[sa.Column[Any], ...]:
    """Return the columns of a note on an alert: when, by whom and why."""
    names = ("at", "who", "why")
    return tuple(sa.Column(f"{prefix}_{n}", UtcTime if n == "at" else sa.Text) for n in names)


def model() -> sa.Column[str]:
    """The name of a model class."""
    # An adopted class is named after its effects, where they act and their ranges.
    return sa.Column("model", sa.String(512), nullable=False)


def superseded_at() -> sa.Column[Any]:
    """Return the column for when a later run replaced a row."""
    # What a later run has replaced stays with its lineage; empty of what is in force.
    return sa.Column("superseded_at", UtcTime)


def index_in_force(name: str, *columns: str) -> sa.Index:
    """An index of what is in force."""
    # `superseded_at` stands behind the samples or the frequency response of a row, which may be a
    # hundred pages of the file: an index of what is in force spares reading past them.
    return sa.Index(name, *columns, sqlite_where=sa.text("superseded_at IS NULL"))


def unique_where(condition: str, table: str, *columns: str) -> sa.Index:
    """Unique among rows in which `condition` is empty."""
    # In PostgreSQL, too: the migrations make them there. Said here it would load that dialect.
    where = sa.text(f"{condition} IS NULL")
    name = f"uq_{table}_{'_'.join(columns)}"
    return sa.Index(name, *columns, unique=True, sqlite_where=where)


_TYPES: Mapping[Any, Any] = {
    bool: sa.Boolean,
    bytes: sa.LargeBinary,
    datetime: UtcTime,
    float: Number,
    int: sa.Integer,
    str: sa.Text,
}
T = TypeVar("T")


def mapped(
    table: str,
    values: type,
    /,
    *others: sa.Column[Any] | sa.Constraint | sa.Index,
    without: Collection[str] = (),
    **given: Any,
) -> sa.Table:
    """Return a table with a column for each field of a dataclass.

    Fields that are dataclasses themselves are laid flat. Fields `without` a column are computed or
    joined. `given` are types, or columns, that do not follow from a field's annotation; `others`
    are columns and constraints of no field.
    """
    columns: list[sa.Column[Any]] = []
    for field, hint in _flat(values, without):
        column = given.pop(field, None)
        if not isinstance(column, sa.Column):
            column = _column(column, hint)
        column.name = column.key = field
        if field == "id":
            column.primary_key, column.nullable = True, False
        columns.append(column)
    assert not given, f"no such field of {values.__name__}: {', '.join(given)}"
    keys = [each for each in (*others, *columns) if getattr(each, "primary_key", False)]
    rest = [each for each in (*columns, *others) if not getattr(each, "primary_key", False)]
    return sa.Table(table, metadata, *keys, *rest)


def value_in(row: Row[Any], kind: type[T], **given: Any) -> T:
    """Return a row as a value; fields that the row lacks are `given`, or have their default."""
    found: T = _value_of_row(row._mapping, kind, given)
    return found


def row_of(value: Any, table: sa.Table) -> dict[str, Any]:
    """Return a value by the columns of a table; its number is left to the table where it is 0."""
    found: dict[str, Any] = {}
    for name, nested in _fields(value.__class__):
        item = getattr(value, name)
        if name in table.c:
            found[name] = item
        elif nested is not None and item is not None:
            found |= row_of(item, table)
    if not found.get("id", True):
        del found["id"]
    return found


def insert_value(connection: Connection, table: sa.Table, value: T, **others: Any) -> T:
    """Insert a value with other columns; return it with its number."""
    number = insert(connection, table, row_of(value, table) | others)
    return replace(value, id=number)  # type: ignore[type-var]


def _value_of_row(row: Mapping[Any, Any], kind: Any, given: Mapping[str, Any]) -> Any:
    values = dict(given)
    for name, nested in _fields(kind):
        if name in given:
            continue
        if name in row:
            values[name] = row[name]
        elif nested is not None:
            values[name] = _value_of_row(row, nested, {})
    return kind(**values)


def _column(given: Any, hint: Any) -> sa.Column[Any]:
    is_optional = NoneType in get_args(hint)
    if given is None:
        plain = _without_none(hint)
        is_name = isinstance(plain, type) and issubclass(plain, StrEnum)
        given = Name(plain) if is_name else _TYPES[plain]
    return sa.Column(given, nullable=is_optional or getattr(given, "may_be_null", False))


def _flat(kind: type, without: Collection[str] = ()) -> list[tuple[str, Any]]:
    hints, found = get_type_hints(kind), list[tuple[str, Any]]()
    for name, nested in _fields(kind):
        if name not in without:
            found += [(name, hints[name])] if nested is None else _flat(nested)
    return found


@cache
def _fields(kind: Any) -> tuple[tuple[str, Any], ...]:
    """Return the stored fields of a dataclass, each with its own dataclass if it is one."""
    hints = get_type_hints(kind)
    stored = (each.name for each in fields(kind) if each.metadata.get("stored", True))
    plain = {name: _without_none(hints[name]) for name in stored}
    return tuple((name, each if is_dataclass(each) else None) for name, each in plain.items())


def _without_none(hint: Any) -> Any:
    """Return an annotation without `None`."""
    if get_origin(hint) in (Union, UnionType):
        options = [each for each in get_args(hint) if each is not NoneType]
        return options[0] if len(options) == 1 else hint
    return hint
