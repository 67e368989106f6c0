"""All that a test's page, its documents and its figures are made from, as far as it is at hand.

The sheet of a stored test: at once as far as the store goes, whole from its raw file.

The interactive figures of a test page in reading order: those of the report, drawn by plotly.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np

from shm.errors import NothingThere
from shm.identify import Identification, Poles
from shm.pipeline.lineage import identify_lineage
from shm.pipeline.reporting import modal_test_report
from shm.report.contents import ModalTestReport
from shm.report.figures.modal_test_axes import ResponseCurves, Spectrum
from shm.report.figures.modal_test_hits import FIGURE as HITS
from shm.report.figures.modal_test_modes import SHAPES, STABILISATION, rows_of
from shm.report.figures.modal_test_response import FIGURE as RESPONSE
from shm.report.figures.modal_test_time_history import FIGURE as TIME_HISTORY
from shm.report.figures.specification import FigureSpec, Specification
from shm.report.modal_test_report import conditions, dropped, hits, summary
from shm.report.paper import Table
from shm.store import Lineage, Store, StoredRecording, StoredTest, Workspace
from shm.store.archive import MODES_SUFFIX
from shm.store.tests import load_frequency_response
from shm_daemon.web import with_plotly
from shm_daemon.web.background_work import BackgroundWorker

_ROW_PX, _REST_PX = 118, 90
"""Of the mode shapes: a row of panels, and what is above and below them."""


@dataclass(frozen=True)
class TestFigure:
    """A figure of the report as the page shows it.

    `source` says what it needs: what the store holds; the raw file, identified once more; or
    `both`, where the store has enough to begin with and the raw file adds to it. `tab` is the part
    of the page that holds it. `is_wide`: a phone scrolls it sideways.
    """

    __test__ = False  # told to pytest

    tab: str
    member: FigureSpec[ResponseCurves]
    source: Literal["store", "both", "file"]
    height_px: Callable[[ModalTestReport], int]
    is_wide: bool = False

    @property
    def name(self) -> str:
        return self.member.name

    @property
    def title(self) -> str:
        return self.member.title

    def document(self, shown: ResponseCurves) -> dict[str, Any] | None:
        """Return the plotly document with its words; None where there is nothing to show."""
        found = self.member.draw(shown)
        if not isinstance(found, Specification):
            return None
        return with_plotly.with_words(found, self.member.caption(shown), self.member.alt(shown))


# Judgement: a figure of one panel fits a laptop's screen with its caption, one of several fills it.
MEMBERS: tuple[TestFigure, ...] = (
    TestFigure("Response", RESPONSE, "both", lambda sheet: 620),
    TestFigure("Response", STABILISATION, "file", lambda sheet: 520),
    TestFigure("Hits", TIME_HISTORY, "file", lambda sheet: 640),
    TestFigure("Hits", HITS, "file", lambda sheet: 720),
    TestFigure(
        "Shapes",
        SHAPES,
        "store",
        lambda sheet: _REST_PX + _ROW_PX * len(rows_of(sheet)),
        is_wide=True,
    ),
)
FIGURES = {figure.name: figure for figure in MEMBERS}
FROM_RECORDS = tuple(figure for figure in MEMBERS if figure.source == "file")


AT_WORK = "The raw file is being identified once more; this comes in some seconds."


@dataclass(frozen=True)
class Figure:
    """A figure over HTTP: its JSON, None while it is worked out, and whether more will come.

    `provisional` is what the store alone gives, while the rest is worked out.
    """

    document: bytes | None
    provisional: bool = False


@dataclass(frozen=True, eq=False)
class ModalTestView:
    """A stored test with its file, and the whole sheet of it where it was worked out lately."""

    workspace: Workspace
    store: Store
    background_worker: BackgroundWorker[WorkedOut]
    stored: StoredTest
    recording: StoredRecording

    @property
    def is_archived(self) -> bool:
        return self.workspace.archive.holds(self.recording.file)

    @property
    def missing(self) -> str:
        """Return why only stored results are shown; empty if the raw file can be read."""
        name = self.recording.file.file_name
        if name.lower().endswith(MODES_SUFFIX):
            return (
                f"{name} gave the modes of this test, not what they come from: no signals, hits, "
                "responses or poles were ever here."
            )
        if not self.is_archived:
            return (
                f"The raw file {name} was taken out of the archive: signals, hits, poles and the "
                "fit of the modes cannot be drawn. `shm archive fetch` brings a copy back."
            )
        return ""

    @cached_property
    def order(self) -> ModalTestOrder:
        """Return the request for the results of a test, as stored and as identified now."""
        stored, workspace = self.stored, self.workspace
        terms = identify_lineage(self.recording, stored.hanger, workspace)
        return ModalTestOrder(
            workspace.folder, stored.hanger, stored.test.id, stored.lineage, terms
        )

    @cached_property
    def worked(self) -> WorkedOut | None:
        """The whole sheet, where it is at hand; begins nothing."""
        return None if self.missing else self.background_worker.stored(self.order)

    @cached_property
    def sheet(self) -> ModalTestReport:
        """The whole sheet without its records, or what the store has of it."""
        return self.worked.sheet if self.worked else self.as_stored

    @cached_property
    def as_stored(self) -> ModalTestReport:
        """Return the stored results of a test: no records, hits, poles and fit."""
        stored, settings = self.stored, self.workspace.settings
        response = load_frequency_response(self.store, stored)
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
            band_hz=(settings.band_low_hz, settings.band_high_hz) if response is not None else None,
        )
        return ModalTestReport(found, (), self.workspace.bridge.hanger(stored.hanger))

    @property
    def summary(self) -> str:
        """Return one paragraph in plain words."""
        return summary(self.sheet)

    def whole(self) -> WorkedOut | None:
        """Return the whole sheet; None while it is worked out, which this begins.

        Raises NothingThere where there is no more than the store holds, and the ShmError with
        which working it out failed.
        """
        if self.missing:
            raise NothingThere(self.missing)
        return self.background_worker.get_or_start(self.order)

    def shown(self, point: int = 0) -> ResponseCurves:
        """Return the data of the figures, without any record."""
        if self.worked:
            return ResponseCurves(self.worked.sheet, self.worked.spectrum, point)
        return ResponseCurves.of(self.as_stored, point)

    def figures(self) -> tuple[TestFigure, ...]:
        """Return the figures that this test has, or may have after a new identification."""
        if not self.missing:
            return MEMBERS
        shown = self.shown()
        return tuple(each for each in MEMBERS if each.source != "file" and each.member.draw(shown))

    def figure(self, figure: TestFigure, point: int) -> Figure:
        """Return a figure at the response of index `point`; raises as `whole`, and NothingThere."""
        found = None if figure.source == "file" else figure.document(self.shown(point))
        packed = json.dumps(found, allow_nan=False).encode() if found else None
        if self.worked:
            packed = self.worked.figures.get(figure.name) or packed
        elif figure.source != "store" and not (found and self.missing):
            is_made = self.whole() is not None  # since we looked
            return Figure(packed, provisional=is_made or found is not None)
        if packed is None:
            raise NothingThere(f"{figure.title}: this test has nothing for it.")
        return Figure(packed)


_NO_POLES = Poles(np.empty(0), np.empty(0), np.empty(0), np.empty(0, bool))


@dataclass(frozen=True, eq=False)
class WorkedOut:
    """A whole sheet but for its records, and what was made of those: tables, figures.

    `figures` are documents as JSON bytes, by name; those that came to nothing are not among them.
    """

    sheet: ModalTestReport
    spectrum: Spectrum | None
    hits: Table
    dropped: Table
    conditions: Table
    figures: Mapping[str, bytes]


@dataclass(frozen=True)
class ModalTestOrder:
    """A sheet to be worked out: of which stored identification, and under which terms."""

    folder: Path
    hanger_id: int
    name: str
    stored: Lineage
    terms: Lineage

    def make(self) -> WorkedOut:
        """Identify the raw file once more; raises what `modal_test_report` does.

        It runs in a process of its own: the workspace is opened anew.
        """
        workspace = Workspace.open(self.folder)
        with workspace.store() as store:
            sheet = modal_test_report(workspace, store, self.hanger_id, self.name)
        whole = ResponseCurves.of(sheet, point=0)
        documents = {figure.name: figure.document(whole) for figure in FROM_RECORDS}
        return WorkedOut(
            sheet=replace(sheet, records=()),
            spectrum=whole.spectrum,
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
