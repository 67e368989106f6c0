"""What holds instead of `bridge.toml`."""

from __future__ import annotations

from collections.abc import Iterator

from shm_daemon.doctor.checks import Examined, Finding, ok


def check_changed_settings(examined: Examined) -> Iterator[Finding]:
    """Who reads `bridge.toml` must learn what holds instead of it."""
    changed = examined.store.settings.list_current().values()
    yield ok("settings", "; ".join(map(str, changed)) or "all as bridge.toml says")
