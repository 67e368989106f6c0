"""The bridge of `shm demo`: which hangers are simulated, and which is measured."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

from shm.bridge.description import load_bridge
from shm_cli import demo

NOW = datetime(2026, 9, 10, 13, 25, tzinfo=UTC)


def test_the_season_ends_today(tmp_path: Path) -> None:
    """Of the hangers that are tested to its end; none is tested in the future."""
    described = tmp_path / "bridge.toml"
    described.write_text(demo.bridge_description(), encoding="utf-8")
    times = [
        each.time
        for each in demo.planned(load_bridge(described).hangers, demo.season_start(NOW))
        if each.hanger.id in (demo.SOUND, demo.LOSING)
    ]
    assert NOW - timedelta(hours=3) < max(times) < NOW


def test_planned_simulates_nothing_measured(tmp_path: Path) -> None:
    described = tmp_path / "bridge.toml"
    described.write_text(demo.bridge_description(), encoding="utf-8")
    hangers = load_bridge(described).hangers
    simulated = {each.hanger.id for each in demo.planned(hangers, demo.season_start(NOW))}
    assert simulated == {each.id for each in hangers} - {demo.MEASURED}
    assert demo.LOSING in simulated
    (measured,) = (each for each in hangers if each.id == demo.MEASURED)
    assert measured.length_m == 12.0  # as in the thesis
