"""What all tests share."""

from __future__ import annotations

import gc
import logging
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.helpers.postgres import Databases, postgresql_server
from tests.helpers.quick_stores import (
    copy_new_stores,
    hash_passwords_quickly,
    share_compiled_statements,
    wait_for_no_disk,
)

os.environ.pop("COLUMNS", None)  # the processes of pytest-xdist set it, a single one does not
gc.disable()  # until all tests are collected: what collecting makes stays, a seventh of its time


def pytest_collection_finish() -> None:
    """Modules and thousands of tests are no garbage: not to be looked through again, 0.5 s each."""
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="session", autouse=True)
def cache_of_reduced_bases(tmp_path_factory) -> Iterator[None]:
    """Each run makes its own bases, once for all its processes, and leaves the user's alone."""
    before = os.environ.get("SHM_CACHE")
    own = tmp_path_factory.getbasetemp()
    several = "PYTEST_XDIST_WORKER" in os.environ
    os.environ["SHM_CACHE"] = str((own.parent if several else own) / "cache")
    yield
    if before is None:
        del os.environ["SHM_CACHE"]
    else:
        os.environ["SHM_CACHE"] = before


@pytest.fixture(scope="session", autouse=True)
def quick_stores(tmp_path_factory) -> Iterator[None]:
    """Do once in a process what each of hundreds of new stores would repeat."""
    with pytest.MonkeyPatch.context() as patch:
        copy_new_stores(patch, tmp_path_factory.mktemp("template"))
        share_compiled_statements(patch)
        wait_for_no_disk(patch)
        hash_passwords_quickly(patch)
        yield


@pytest.fixture(autouse=True)
def logging_ends_with_its_test() -> Iterator[None]:
    """Remove log handlers of a test, whose standard error is closed at its end."""
    root, level = logging.getLogger(), logging.getLogger().level
    before = set(root.handlers)
    yield
    root.setLevel(level)
    for handler in set(root.handlers) - before:
        if type(handler).__module__ != "_pytest.logging":  # pytest's own are another each phase
            root.removeHandler(handler)
            handler.close()


@pytest.fixture(scope="session")
def postgresql() -> Iterator[Databases]:
    """Start a PostgreSQL server for this process at first need."""
    with postgresql_server() as databases:
        yield databases


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Return the folder of real data, which a checkout may be without."""
    fallback = Path(__file__).resolve().parents[2] / "shared" / "data"
    folder = Path(os.environ.get("SHM_DATA", fallback))
    if not folder.is_dir():
        pytest.skip(f"no real data in {folder}; set SHM_DATA to run this test")
    return folder
