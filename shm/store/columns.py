"""Column types that hold our values the same way in SQLite and PostgreSQL."""

from __future__ import annotations

import math
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Dialect

from shm.documents import dump
from shm.values import NAN

UNREADABLE_TIME = datetime.min.replace(tzinfo=UTC)
"""Stands for a time in a damaged row: the row's checksum tells, and other rows are not held up."""


class Number(sa.types.TypeDecorator[float]):
    """A float whose unknown value is NaN in memory and NULL in the table."""

    impl = sa.Double
    cache_ok = True

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

    def result_processor(
        self, dialect: Dialect, coltype: object
    ) -> Callable[[Any], datetime | None] | None:
        process = super().result_processor(dialect, coltype)

        def read(value: Any) -> datetime | None:
            try:
                return process(value) if process is not None else value
            except (ValueError, TypeError):
                return UNREADABLE_TIME

        return read

    def process_result_value(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        if value is None:
            return None
        return value.astimezone(UTC) if value.tzinfo else value.replace(tzinfo=UTC)


class Document(sa.types.TypeDecorator[Any]):
    """A JSON document as text; NaN is null, times are ISO texts.

    It comes back as text: what it says is read where it is compared with the checksum of its row.
    """

    impl = sa.Text
    cache_ok = True

    def process_bind_param(self, value: Any, dialect: Dialect) -> str | None:
        return None if value is None else dump(value)
