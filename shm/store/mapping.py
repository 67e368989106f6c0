"""Tables whose rows are values of a frozen dataclass: a field is written once, in its class."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import fields, is_dataclass, replace
from datetime import datetime
from enum import StrEnum
from types import NoneType, UnionType
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.store.columns import Name, Number, UtcTime, metadata
from shm.store.database import insert

_TYPES: Mapping[Any, Any] = {
    bool: sa.Boolean,
    bytes: sa.LargeBinary,
    datetime: UtcTime,
    float: Number,
    int: sa.Integer,
    str: sa.Text,
}
T = TypeVar("T")
_FIELDS: dict[Any, tuple[tuple[str, Any], ...]] = {}


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
    return _value(row._mapping, kind, given)


def row_of(value: object, table: sa.Table) -> dict[str, Any]:
    """Return a value by the columns of a table; its number is left to the table where it is 0."""
    found: dict[str, Any] = {}
    for name, nested in _fields(type(value)):
        own = getattr(value, name)
        if name in table.c:
            found[name] = own
        elif nested is not None and own is not None:
            found |= row_of(own, table)
    if not found.get("id", True):
        del found["id"]
    return found


def insert_value(connection: Connection, table: sa.Table, value: T, **others: Any) -> T:
    """Insert a value with other columns; return it with its number."""
    number = insert(connection, table, row_of(value, table) | others)
    return replace(value, id=number)  # type: ignore[type-var]


def _value(row: Mapping[Any, Any], kind: type[T], given: Mapping[str, Any]) -> T:
    values = dict(given)
    for name, nested in _fields(kind):
        if name in given:
            continue
        if name in row:
            values[name] = row[name]
        elif nested is not None:
            values[name] = _value(row, nested, {})
    return kind(**values)


def _column(given: Any, hint: Any) -> sa.Column[Any]:
    is_optional = NoneType in get_args(hint)
    if given is None:
        plain = _plain(hint)
        is_name = isinstance(plain, type) and issubclass(plain, StrEnum)
        given = Name(plain) if is_name else _TYPES[plain]
    return sa.Column(given, nullable=is_optional or getattr(given, "may_be_null", False))


def _flat(kind: type, without: Collection[str] = ()) -> list[tuple[str, Any]]:
    hints, found = get_type_hints(kind), list[tuple[str, Any]]()
    for name, nested in _fields(kind):
        if name not in without:
            found += [(name, hints[name])] if nested is None else _flat(nested)
    return found


def _fields(kind: Any) -> tuple[tuple[str, Any], ...]:
    """Return the stored fields of a dataclass, each with its own dataclass if it is one."""
    if kind not in _FIELDS:
        hints = get_type_hints(kind)
        stored = [each.name for each in fields(kind) if each.metadata.get("stored", True)]
        plain = {name: _plain(hints[name]) for name in stored}
        _FIELDS[kind] = tuple(
            (n, each if is_dataclass(each) else None) for n, each in plain.items()
        )
    return _FIELDS[kind]


def _plain(hint: Any) -> Any:
    """Return an annotation without `None`."""
    if get_origin(hint) in (Union, UnionType):
        own = [each for each in get_args(hint) if each is not NoneType]
        return own[0] if len(own) == 1 else hint
    return hint
