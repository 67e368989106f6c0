"""`shm ingest --held`, `--confirm` and `--discard`: a person answers what is held."""

from __future__ import annotations

from collections.abc import Callable

from click.testing import Result

Shm = Callable[..., Result]
