"""Effects and model classes of other packages: a fake distribution on the path offers them."""

from __future__ import annotations

from pathlib import Path

import pytest

from shm.errors import UsageError
from shm.models.classes.base import Model
from shm.models.classes.beam import Beam1
from shm.models.effects import EFFECTS
from shm.models.effects.base import Effect
from shm.models.plug_ins import (
    EFFECTS_GROUP,
    MODELS_GROUP,
    PlugInSkipped,
    members_with_plug_ins,
)

MODULE = """
from shm.models.classes.beam import Beam1
from shm.models.effects.of_mass import UnknownPointMass

class Lamp(UnknownPointMass):
    name = "lamp"

class Beam9(Beam1):
    name = "beam9"

class Again(UnknownPointMass):
    name = "sag"
"""


def installed(folder: Path, monkeypatch: pytest.MonkeyPatch, entries: str) -> None:
    """A distribution `bridge-extras` with one module and these entry points."""
    info = folder / "bridge_extras-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: bridge-extras\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(entries)
    (folder / "bridge_extras_of_a_test.py").write_text(MODULE)
    monkeypatch.syspath_prepend(folder)


def test_an_effect_and_a_model_class_come_from_outside(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    installed(
        tmp_path,
        monkeypatch,
        "[shm.effects]\nlamp = bridge_extras_of_a_test:Lamp\n"
        "[shm.models]\nbeam9 = bridge_extras_of_a_test:Beam9\n",
    )
    effects = members_with_plug_ins(EFFECTS_GROUP, EFFECTS, Effect)
    assert list(effects) == [*EFFECTS, "lamp"]
    assert isinstance(effects["lamp"], Effect)
    models = members_with_plug_ins(MODELS_GROUP, {"beam1": Beam1}, Model)
    assert issubclass(models["beam9"], Beam1)


@pytest.mark.parametrize(
    ("entry", "reason"),
    [
        ("bridge_extras_of_a_test:Gone", "AttributeError"),
        ("no_such_module_of_a_test:Lamp", "ModuleNotFoundError"),
        ("bridge_extras_of_a_test:Beam9", "TypeError"),
    ],
)
def test_a_broken_plug_in_is_named_and_left_out(
    entry: str, reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    installed(tmp_path, monkeypatch, f"[shm.effects]\nbad = {entry}\n")
    with pytest.warns(PlugInSkipped, match=rf"bad = {entry} \(package bridge-extras\).*{reason}"):
        assert members_with_plug_ins(EFFECTS_GROUP, EFFECTS, Effect) == EFFECTS


def test_a_name_that_is_taken_is_an_error_that_names_both(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    installed(tmp_path, monkeypatch, "[shm.effects]\nsag = bridge_extras_of_a_test:Again\n")
    with pytest.raises(UsageError, match=r"'sag', that of shm and plug-in .*bridge-extras"):
        members_with_plug_ins(EFFECTS_GROUP, EFFECTS, Effect)
