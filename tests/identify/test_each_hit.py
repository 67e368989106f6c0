"""Each hit by itself: its modes, and its line of the table."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shm.identify import IdentifyOptions, identify
from shm.identify.each_hit import as_csv
from tests.contracts.inference_calls import call
from tests.identify.signals import hanger_modes, recording

OPTIONS = IdentifyOptions(2.0, 50.0)


def test_each_hit_has_the_frequency_and_damping_of_each_mode() -> None:
    found = identify([recording(hanger_modes(), noise=0.01)], OPTIONS, test_id="t")
    assert len(found.each_hit) == len(found.hits) == 5
    for row in found.each_hit:
        for mode, hz, damping in zip(
            found.test.modes, row.frequency_hz, row.damping_ratio, strict=True
        ):
            assert hz == pytest.approx(mode.frequency_hz, rel=1e-3)
            assert damping == pytest.approx(mode.damping_ratio, rel=0.25)


def test_a_hit_that_is_not_used_has_its_reason_and_no_modes() -> None:
    record = recording(hanger_modes(), noise=0.01)
    force = record.channels[0].values.copy()
    force[8 * 1024 + 4000] = np.nan
    broken = replace(
        record, channels=(replace(record.channels[0], values=force), *record.channels[1:])
    )
    found = identify([broken], OPTIONS, test_id="t")
    row = found.each_hit[1]
    assert not row.hit.used
    assert np.isnan(row.frequency_hz).all()
    lines = list(csv.DictReader(as_csv(found.each_hit, found.test.modes).splitlines()))
    assert [line["used"] for line in lines] == ["yes", "no", "yes", "yes", "yes"]
    assert lines[1]["reason"] == "not-a-number samples"
    assert lines[1]["transverse_1_hz"] == ""
    assert float(lines[0]["transverse_1_hz"]) == pytest.approx(6.0, rel=2e-3)
    assert float(lines[2]["peak_force_n"]) > 0
    assert {line["double_hit"] for line in lines} == {"no"}


def test_the_command_writes_the_table(tmp_path: Path) -> None:
    rod = Path(__file__).parents[1] / "contracts" / "golden" / "rod.toml"
    made = call("simulate", "--hanger-file", rod, "--hits", 2, "--seconds", 5, "--rate", 512,
                "--out", tmp_path / "sim")  # fmt: skip
    assert made.code == 0, made.err
    (record,) = (tmp_path / "sim").glob("*.csv")
    table = tmp_path / "hits.csv"
    ended = call("identify", record, "--hanger-file", rod, "--hits", table, "--json")
    (test,) = ended.document["tests"]
    lines = list(csv.DictReader(table.read_text().splitlines()))
    assert [line["hit"] for line in lines] == ["1", "2"]
    assert all(f"{m['plane']}_{m['order']}_hz" in lines[0] for m in test["modes"])
    several = call("identify", record, record, "--hits", tmp_path / "other.csv")
    assert several.code == 2
    assert "--hits shows one test" in several.err
