"""A workspace for one who only reads it."""

from __future__ import annotations

import warnings
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

from shm.api.in_python import in_python
from shm.errors import BadInput, NothingThere
from shm.read import read_test
from shm.values import (
    Averaged,
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
    """Read what a workspace stores of its hangers: tensions, tests, posteriors, raw records.

    It only reads, also while a daemon works on the same workspace. `workspace` is the folder with
    `bridge.toml`. Use it in a `with`, or close it. Raises BadInput where `bridge.toml` is missing
    or wrong, NothingThere, SchemaOutdated or StoreError where the store cannot be opened.

    Example:
        >>> with shm.Store("arch") as store:
        ...     tension = store.tension(3).tension_n
        >>> tension.mean, tension.q05, tension.q95
        (711000.0, 669000.0, 742000.0)
    """

    def __init__(self, workspace: str | Path):
        # The store's libraries take a second to load, and most notebooks open none.
        from shm.store import Workspace

        bridge = Path(workspace) / "bridge.toml"
        if not bridge.is_file():
            lacks = "holds no bridge.toml" if bridge.parent.is_dir() else "is no folder"
            raise BadInput(
                f"{workspace} {lacks}, so it is no workspace.",
                remedy='Give the folder that holds bridge.toml: shm.Store("arch"). '
                "`shm init arch` in a terminal makes one.",
            )
        with in_python():
            self._workspace = Workspace.described(workspace)
            self._store = self._workspace.store()

    @property
    def hangers(self) -> tuple[Hanger, ...]:
        """The hangers of the bridge, as `bridge.toml` describes them now."""
        return self._workspace.bridge.hangers

    def hanger(self, hanger_id: int) -> Hanger:
        """Return one hanger; raises BadInput when the bridge has none such."""
        return self._workspace.bridge.hanger(hanger_id)

    def tests(self, hanger_id: int) -> tuple[ModalTest, ...]:
        """Return the modal tests of a hanger, oldest first; empty before the first."""
        self.hanger(hanger_id)
        return tuple(stored.test for stored in self._store.tests.list_all(hanger_id))

    def tension(self, hanger_id: int, test_id: str | None = None) -> Averaged:
        """Return a hanger's tension in N: the best estimate since its last change, or by a test.

        It is averaged over all model classes and absolute, the headline of reports and pages:
        `tension_n.mean`, with a 90 % interval from `tension_n.q05` to `tension_n.q95`. With
        `test_id` it is what that test says alone. Raises NothingThere.
        """
        found = (
            self._headline(hanger_id) if test_id is None else self.tensions(hanger_id).get(test_id)
        )
        if found is None:
            self._store.posteriors.get(hanger_id, test_id)  # raises what is missing
            raise NothingThere(f"hanger {hanger_id} has no tension.", remedy="Run `shm doctor`.")
        return found

    def tensions(self, hanger_id: int) -> dict[str, Averaged]:
        """Return the tension by each test of a hanger, oldest first: see `tension`."""
        from shm.store.posteriors import list_trend

        points = list_trend(self._store, self.hanger(hanger_id))
        return {point.test: point.averaged for point in points}

    def _headline(self, hanger_id: int) -> Averaged | None:
        from shm.pipeline import utc_now
        from shm.pipeline.bridge_reporting import hanger_summaries

        hanger = self.hanger(hanger_id)
        (summary,) = hanger_summaries(self._workspace, self._store, utc_now(), [hanger])
        return summary.tension

    def posterior(
        self, hanger_id: int, test_id: str | None = None, model: str | None = None
    ) -> Posterior:
        """Return the latest posterior of a hanger, or that of one test, in one model class.

        Its interval leaves out that another class may be right: `tension` does not. Name the class
        as `model`; without it that is the selected one, and a UserWarning says so. Of the other
        classes there are posteriors of the tests that made the baseline. Raises NothingThere.
        """
        self.hanger(hanger_id)
        found = self._store.posteriors.get(hanger_id, test_id)
        if model is None:
            warnings.warn(
                f"posterior({hanger_id}) is of the model class {found.model} alone, and its "
                f"interval is too narrow for the tension. Use tension({hanger_id}), or name the "
                f"class: posterior({hanger_id}, model={found.model!r}).",
                UserWarning,
                stacklevel=2,
            )
            return found
        if found.model == model:
            return found
        compared = self._store.posteriors.selection(hanger_id)
        classes = compared.selection.posteriors if compared is not None else ()
        for each in classes:
            if each.model == model and (test_id is None or test_id in each.tests):
                return each
        of_test = f" by test {test_id}" if test_id is not None else ""
        names = ", ".join(sorted({found.model, *(each.model for each in classes)}))
        raise NothingThere(
            f"hanger {hanger_id} has no posterior of the class {model}{of_test}.",
            remedy=f"Its classes are {names}; all but {found.model} are of its baseline alone.",
        )

    def posteriors(self, hanger_id: int) -> tuple[Posterior, ...]:
        """Return the posterior of each test in its one model class, oldest first: all samples.

        For the tension over all classes see `tensions`.
        """
        from shm.store.posteriors import list_history

        self.hanger(hanger_id)
        return tuple(posterior for _, posterior in list_history(self._store, hanger_id))

    def selection(self, hanger_id: int) -> Selection:
        """Return the model classes compared on the hanger's first tests; raises NothingThere."""
        self.hanger(hanger_id)
        found = self._store.posteriors.selection(hanger_id)
        if found is None:
            raise NothingThere(
                f"no model class is selected for hanger {hanger_id} yet.",
                remedy="Take tests of it into the workspace, or call shm.select(tests, hanger).",
            )
        return found.selection

    def diagnosis(self, hanger_id: int) -> Diagnosis:
        """Return the latest gap diagnosis of a hanger; raises NothingThere."""
        from shm.store.watch import find_latest_diagnosis

        self.hanger(hanger_id)
        found = find_latest_diagnosis(self._store, hanger_id)
        if found is None:
            raise NothingThere(
                f"the gap of hanger {hanger_id} has not been diagnosed yet.",
                remedy=f"Call shm.diagnose(store.tests({hanger_id}), store.hanger({hanger_id})).",
            )
        return found.diagnosis

    def records(self, hanger_id: int, test_id: str) -> tuple[Recording | FrequencyResponse, ...]:
        """Return the raw records of a test from the archive; raises NothingThere for another one.

        Raises BadInput where a file gave the modes and holds no record.
        """
        stored = self._stored(hanger_id, test_id)
        file = self._store.recordings.get(stored.recording_id).file
        with self._workspace.archive.opened(file) as path:
            return read_test(path)

    def frequency_response(self, hanger_id: int, test_id: str) -> FrequencyResponse:
        """Return the response behind a test's modes; raises NothingThere without one."""
        from shm.store.tests import load_frequency_response

        found = load_frequency_response(self._store, self._stored(hanger_id, test_id))
        if found is None:
            raise NothingThere(
                f"no frequency response of test {test_id} is kept.",
                remedy="Ask for a test that a hammer made and that was identified here.",
            )
        return found

    def close(self) -> None:
        """Let go of the database."""
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
