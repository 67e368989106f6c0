"""All that a test's page, its documents and its figures are made from, as far as it is at hand."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from shm.errors import NothingThere
from shm.report import TestSheet
from shm.report.sheet.spectra import spectrum
from shm.report.sheet.summary import advice, trust
from shm.store import Store, StoredRecording, StoredTest, Workspace
from shm.store.archive import MODES_SUFFIX
from shm_daemon.web.hangers import described
from shm_daemon.web.test_figures.contract import Shown, TestFigure
from shm_daemon.web.test_figures.registry import MEMBERS
from shm_daemon.web.test_sheets import SheetOrder, WorkedOut, order_of, stored_sheet
from shm_daemon.web.working_out import Workshop

AT_WORK = "The raw file is being identified once more; this comes in some seconds."


@dataclass(frozen=True)
class Figure:
    """A figure over HTTP: its document, None while it is worked out, and whether more will come.

    `provisional` is what the store alone gives, while the rest is worked out.
    """

    document: dict[str, Any] | bytes | None
    provisional: bool = False


@dataclass(frozen=True, eq=False)
class TestView:
    """A stored test with its file, and the whole sheet of it where it was worked out lately."""

    __test__ = False  # told to pytest

    workspace: Workspace
    store: Store
    workshop: Workshop[WorkedOut]
    stored: StoredTest
    recording: StoredRecording

    @classmethod
    def of(
        cls, workspace: Workspace, store: Store, workshop: Workshop[Any], hanger_id: int, name: str
    ) -> TestView:
        """Raises NothingThere for a hanger or a test that is none."""
        stored = store.test_named(described(workspace, hanger_id).id, name)
        return cls(workspace, store, workshop, stored, store.recording(stored.recording_id))

    @property
    def is_archived(self) -> bool:
        return self.workspace.archive.holds(self.recording.file)

    @property
    def missing(self) -> str:
        """Why there is no more than the store holds; empty where the raw file can be asked."""
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
    def order(self) -> SheetOrder:
        return order_of(self.workspace, self.recording, self.stored)

    @cached_property
    def worked(self) -> WorkedOut | None:
        """The whole sheet, where it is at hand; begins nothing."""
        return None if self.missing else self.workshop.kept(self.order)

    @cached_property
    def sheet(self) -> TestSheet:
        """The whole sheet without its records, or what the store has of it."""
        return self.worked.sheet if self.worked else self.as_stored

    @cached_property
    def as_stored(self) -> TestSheet:
        return stored_sheet(self.workspace, self.store, self.stored)

    @property
    def summary(self) -> str:
        """One paragraph in plain words."""
        if self.worked:
            return self.worked.summary
        return " ".join(part for part in (trust(self.as_stored), advice(self.as_stored)) if part)

    def whole(self) -> WorkedOut | None:
        """The whole sheet; None while it is worked out, which this begins.

        Raises NothingThere where there is no more than the store holds, and the ShmError with
        which working it out failed.
        """
        if self.missing:
            raise NothingThere(self.missing)
        return self.workshop.wanted(self.order)

    def shown(self, point: int = 0) -> Shown:
        """What figures are drawn from, without any record."""
        if self.worked:
            return Shown(self.worked.sheet, self.worked.spectrum, point)
        return Shown(self.as_stored, spectrum(self.as_stored), point)

    def figures(self) -> tuple[TestFigure, ...]:
        """Those that this test has, or may have once its raw file is identified once more."""
        if not self.missing:
            return MEMBERS
        shown = self.shown()
        return tuple(each for each in MEMBERS if each.source != "file" and each.draw(shown))

    def figure(self, figure: TestFigure, point: int) -> Figure:
        """A figure at the response of index `point`; raises as `whole`, and NothingThere."""
        found = None if figure.source == "file" else figure.document(self.shown(point))
        if self.worked:
            return Figure(_there(self.worked.figures.get(figure.name) or found, figure))
        if figure.source == "store" or (found is not None and self.missing):
            return Figure(_there(found, figure))
        if self.whole() is not None:  # made since we looked
            return Figure(found, provisional=True)
        return Figure(found, provisional=found is not None)


def _there(found: dict[str, Any] | bytes | None, figure: TestFigure) -> dict[str, Any] | bytes:
    if found is None:
        raise NothingThere(f"{figure.title}: this test has nothing for it.")
    return found


def as_bytes(document: dict[str, Any] | bytes) -> bytes:
    """A document as JSON."""
    if isinstance(document, bytes):
        return document
    return json.dumps(document, allow_nan=False).encode()
