"""The product without a mechanism, for as long as a block runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import Any
from unittest.mock import patch

Change = tuple[Any, str, Any]
"""An owner, its attribute and what takes its place."""


@contextmanager
def without(changes: Sequence[Change]) -> Iterator[None]:
    """Make all changes, and undo them afterwards."""
    with ExitStack() as stack:
        for change in changes:
            stack.enter_context(patch.object(*change))
        yield
