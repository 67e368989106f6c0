"""What a workspace keeps, for one who only looks."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

from shm.errors import NothingThere
from shm.read import read_test
from shm.values import (
    Diagnosis,
    FrequencyResponse,
    Hanger,
    ModalTest,
    Posterior,
    Recording,
    Selection,
)

if TYPE_CHECKING:
    from shm.store import StoredTest


class Store:
    """What a workspace keeps of its hangers: tests, posteriors, diagnoses, raw records.

    It only reads, also while a daemon works on the same workspace. `workspace` is the folder with
    `bridge.toml`. Use it in a `with`, or close it. Raises BadInput where `bridge.toml` is missing
    or wrong, NothingThere, SchemaOutdated or StoreError where the store cannot be opened.

    Example:
        >>> with shm.Store("arch") as store:
        ...     posterior = store.posterior(3)
        >>> posterior.tension_n.mean()
        711000.0
    """

    def __init__(self, workspace: str | Path):
        # The store's libraries take a second to load, and most notebooks open none.
        from shm.store import Workspace

        self._workspace = Workspace.described(workspace)
        self._store = self._workspace.store()

    @property
    def hangers(self) -> tuple[Hanger, ...]:
        """The hangers of the bridge, as `bridge.toml` describes them now."""
        return self._workspace.bridge.hangers

    def hanger(self, hanger_id: int) -> Hanger:
        """One hanger; raises BadInput when the bridge has none such."""
        return self._workspace.bridge.hanger(hanger_id)

    def tests(self, hanger_id: int) -> tuple[ModalTest, ...]:
        """The modal tests of a hanger, oldest first; empty before the first."""
        self.hanger(hanger_id)
        return tuple(stored.test for stored in self._store.tests.list_all(hanger_id))

    def posterior(self, hanger_id: int, test_id: str | None = None) -> Posterior:
        """The latest posterior of a hanger, or that of one test; raises NothingThere."""
        self.hanger(hanger_id)
        return self._store.posteriors.get(hanger_id, test_id)

    def posteriors(self, hanger_id: int) -> tuple[Posterior, ...]:
        """The posterior of each test that is through updating, oldest first: all samples."""
        self.hanger(hanger_id)
        return tuple(posterior for _, posterior in self._store.posteriors.history(hanger_id))

    def selection(self, hanger_id: int) -> Selection:
        """The model classes compared on the hanger's first tests; raises NothingThere."""
        self.hanger(hanger_id)
        found = self._store.posteriors.selection(hanger_id)
        if found is None:
            raise NothingThere(
                f"no model class is selected for hanger {hanger_id} yet.",
                remedy="Ingest tests of it.",
            )
        return found.selection

    def diagnosis(self, hanger_id: int) -> Diagnosis:
        """The latest gap diagnosis of a hanger; raises NothingThere."""
        self.hanger(hanger_id)
        found = self._store.posteriors.latest_diagnosis(hanger_id)
        if found is None:
            raise NothingThere(
                f"the gap of hanger {hanger_id} has not been diagnosed yet.",
                remedy=f"Run `shm gap diagnose --hanger {hanger_id}`.",
            )
        return found.diagnosis

    def records(self, hanger_id: int, test_id: str) -> tuple[Recording | FrequencyResponse, ...]:
        """The raw records of a test, from the archive; raises NothingThere for an unknown test.

        Raises BadInput where a file gave the modes and holds no record.
        """
        stored = self._stored(hanger_id, test_id)
        file = self._store.recordings.get(stored.recording_id).file
        with self._workspace.archive.opened(file) as path:
            return read_test(path)

    def frequency_response(self, hanger_id: int, test_id: str) -> FrequencyResponse:
        """What the modes of a test were identified from; raises NothingThere where none is kept."""
        found = self._store.tests.frequency_response(self._stored(hanger_id, test_id))
        if found is None:
            raise NothingThere(
                f"no frequency response of test {test_id} is kept.",
                remedy="Ask for a test that a hammer made and that was identified here.",
            )
        return found

    def close(self) -> None:
        """Lets go of the database."""
        self._store.close()

    def _stored(self, hanger_id: int, test_id: str) -> StoredTest:
        self.hanger(hanger_id)
        return self._store.tests.named(hanger_id, test_id)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
