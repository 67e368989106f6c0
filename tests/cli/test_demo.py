"""The bridge of `shm demo`: which hangers are simulated, and which is measured."""

from __future__ import annotations

from pathlib import Path

from shm.bridge.description import load_bridge
from shm_cli import demo


def test_planned_simulates_nothing_measured(tmp_path: Path) -> None:
    described = tmp_path / "bridge.toml"
    described.write_text(demo.bridge_description(), encoding="utf-8")
    hangers = load_bridge(described).hangers
    simulated = {each.hanger.id for each in demo.planned(hangers)}
    assert simulated == {each.id for each in hangers} - {demo.MEASURED}
    assert demo.LOSING in simulated
    (measured,) = (each for each in hangers if each.id == demo.MEASURED)
    assert measured.length_m == 12.0  # as in the thesis
