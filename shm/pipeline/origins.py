"""Where the numbers of a report come from, in words: files, checksums, settings, software."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from functools import cache
from importlib.metadata import version

from shm.pipeline.lineage import identify_settings
from shm.settings import TABLE, Settings
from shm.store import Store, StoredTest

IDENTIFY_SETTINGS = tuple(identify_settings(Settings()))
_ALL = (*IDENTIFY_SETTINGS, "models", "samples", "seed", "baseline_tests", "false_call_years")
_LIBRARIES = ("numpy", "scipy", "pyOMA-2", "emcee")


def test_lineage(store: Store, test: StoredTest) -> dict[str, str]:
    """The file of a test, the checksums of what its modes come from, the software."""
    file = store.recordings.get(test.recording_id)
    return {
        "file_name": file.file.file_name,
        "file_sha256": file.file.sha256,
        "received": f"{file.received_at:%Y-%m-%d %H:%M} UTC, {file.file.size_bytes} bytes",
        "input_sha256": test.lineage.input_sha256,
        "settings_sha256": test.lineage.settings_sha256,
        "version": test.lineage.version,
        "software": software(),
    }


@cache
def software() -> str:
    """`Python 3.11.2, numpy 2.4.1 ...`: what computes here."""
    libraries = [f"{name} {version(name)}" for name in _LIBRARIES]
    return ", ".join((f"Python {platform.python_version()}", *libraries))


def settings_words(settings: Settings, names: Sequence[str] = _ALL) -> dict[str, str]:
    """The settings that decide the numbers of a report, each with its unit."""
    units = {row.name: row.unit for row in TABLE}
    return {name: f"{getattr(settings, name)} {units[name]}".rstrip() for name in names}
