"""The sheet of a stored test: at once as far as the store goes, whole from its raw file."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from shm.identify import Identification, Poles
from shm.pipeline.reporting import test_sheet
from shm.pipeline.terms import identify_lineage
from shm.report import TestSheet
from shm.report.sheet.spectra import Spectrum
from shm.report.sheet.summary import summary
from shm.report.sheet.tables import conditions, dropped, hits
from shm.report.table import Table
from shm.store import Lineage, Store, StoredRecording, StoredTest, Workspace
from shm_daemon.web.test_figures.contract import Shown
from shm_daemon.web.test_figures.registry import FROM_RECORDS

_NO_POLES = Poles(np.empty(0), np.empty(0), np.empty(0), np.empty(0, bool))


@dataclass(frozen=True, eq=False)
class WorkedOut:
    """A whole sheet but for its records, and what was made of those: words, tables, figures.

    `figures` are documents as JSON bytes, by name; those that came to nothing are not among them.
    """

    sheet: TestSheet
    spectrum: Spectrum | None
    summary: str
    hits: Table
    dropped: Table
    conditions: Table
    figures: Mapping[str, bytes]

    @property
    def size_bytes(self) -> int:
        found, documents = self.sheet.identification, self.figures.values()
        arrays: list[np.ndarray[Any, Any]] = [
            found.poles.order,
            found.poles.frequency_hz,
            found.poles.damping_ratio,
        ]
        if found.fit is not None:
            arrays.append(found.fit)
        if found.frequency_response is not None:
            arrays.append(found.frequency_response.accelerance)
        if self.spectrum is not None:
            arrays.append(self.spectrum.values)
        return sum(array.nbytes for array in arrays) + sum(map(len, documents))


@dataclass(frozen=True)
class SheetOrder:
    """A sheet to be worked out: of which stored identification, and under which terms."""

    folder: Path
    hanger_id: int
    name: str
    stored: Lineage
    terms: Lineage

    def make(self) -> WorkedOut:
        """Identifies the raw file once more; raises what `shm.pipeline.reporting.test_sheet` does.

        It runs in a process of its own: the workspace is opened anew.
        """
        workspace = Workspace.open(self.folder)
        with workspace.store() as store:
            return worked_out(test_sheet(workspace, store, self.hanger_id, self.name))


def order_of(workspace: Workspace, recording: StoredRecording, stored: StoredTest) -> SheetOrder:
    """What to work out of a test as it is stored and would be identified now."""
    terms = identify_lineage(recording, stored.hanger, workspace)
    return SheetOrder(workspace.folder, stored.hanger, stored.test.id, stored.lineage, terms)


def worked_out(sheet: TestSheet) -> WorkedOut:
    """The sheet with all that needs its records made of them."""
    whole = Shown.of(sheet)
    documents = {figure.name: figure.document(whole) for figure in FROM_RECORDS}
    return WorkedOut(
        sheet=replace(sheet, records=()),
        spectrum=whole.spectrum,
        summary=summary(sheet),
        hits=hits(sheet),
        dropped=dropped(sheet),
        # Where it comes from, the page says itself, with the steps.
        conditions=conditions(replace(sheet, lineage={})),
        figures={
            name: json.dumps(document, allow_nan=False).encode()
            for name, document in documents.items()
            if document is not None
        },
    )


def stored_sheet(workspace: Workspace, store: Store, stored: StoredTest) -> TestSheet:
    """What the store knows of a test: no records, hits, poles and fit."""
    response, settings = store.frequency_response(stored), workspace.settings
    found = Identification(
        test=stored.test,
        frequency_response=response,
        hits=(),
        dropped=(),
        poles=_NO_POLES,
        notes=stored.notes,
        window_time_constant_s=math.nan,
        quality=stored.quality,
        set_aside=stored.set_aside,
    )
    band_hz = (settings.band_low_hz, settings.band_high_hz) if response is not None else None
    return TestSheet(found, (), workspace.bridge.hanger(stored.hanger), band_hz)
