"""Each hanger of a bridge is served by the model classes that apply to it."""

from __future__ import annotations

from pathlib import Path

import pytest

from shm.errors import UsageError
from shm.models import MODELS
from shm.models.classes.beam import Beam1
from shm.store import Stage, Workspace
from shm.store.recordings import count_stages
from shm.values import Hanger
from tests.helpers.flows import a_flow, ingest
from tests.helpers.workspaces import make_workspace, write_test

TURNBUCKLE = """
[[hanger.turnbuckle]]
x_m = 1.5
length_m = 0.6
mass_kg = 150
bending_stiffness_n_m2 = 1e7
"""


class Bare(Beam1):
    """A class that knows no turnbuckles."""

    name = "bare"

    @classmethod
    def unfit(cls, hanger: Hanger) -> str:
        return "it knows no turnbuckles." if hanger.turnbuckles else ""


@pytest.fixture(autouse=True)
def _registered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(MODELS, "bare", Bare)


def with_turnbuckle(workspace: Workspace, *, models: str = "") -> Workspace:
    """The workspace, its last hanger with a turnbuckle."""
    path = workspace.folder / "bridge.toml"
    head, settings = path.read_text().split("[settings]")
    path.write_text(f"{head}{models}\n{TURNBUCKLE}\n[settings]{settings}")
    return workspace.reopened()


def test_each_hanger_is_served_by_the_classes_that_apply_to_it(tmp_path: Path) -> None:
    made = make_workspace(tmp_path / "b", hangers=(3, 4), settings={"models": "bare,beam1"})
    workspace = with_turnbuckle(made)
    for number in (3, 4):
        write_test(workspace.spool / f"t{number}.modes.json", workspace, hanger=number)
    ingest(workspace)
    with workspace.store() as store:
        assert count_stages(store)[Stage.DONE] == 2
        found = {number: store.posteriors.selection(number) for number in (3, 4)}
    names = {n: [p.model for p in each.selection.posteriors] for n, each in found.items() if each}
    assert (sorted(names[3]), names[4]) == (["bare", "beam1"], ["beam1"])


def test_a_hanger_without_a_class_is_told_before_any_file_is_touched(tmp_path: Path) -> None:
    made = make_workspace(tmp_path / "b", settings={"models": "bare"})
    workspace = with_turnbuckle(made)
    with (
        pytest.raises(UsageError, match=r"hanger 3.*bare: it knows no turnbuckles"),
        a_flow(workspace),
    ):
        pytest.fail("began")
