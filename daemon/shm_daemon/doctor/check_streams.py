"""Which permanent sensors send nothing, or are at fault."""

from __future__ import annotations

from collections.abc import Iterator

from shm.pipeline.unheard import REMEDIES, heard
from shm.report.formatting import counted
from shm_daemon.doctor.checks import Examined, Finding, ok, some, warning


def check_streams(examined: Examined) -> Iterator[Finding]:
    """Nothing where `bridge.toml` describes no stream."""
    found = heard(examined.workspace, examined.store, examined.now)
    for state, remedy in REMEDIES.items():
        names = [each.named for each in found if each.state == state]
        if names:
            yield warning("streams", f"{state}: {some(names)}", remedy)
    if found and not any(each.state in REMEDIES for each in found):
        yield ok("streams", f"{counted(len(found), 'stream')}, heard within the hour")
