"""The thesis's tables of computed frequencies, as `validate.py` compares them."""

from __future__ import annotations

from dataclasses import replace

import pytest

from shm.bridge import load_hanger
from shm_cli.common import markdown
from shm_cli.example import HANGER_FILE
from tests.benchmarks.thesis import frequencies, selection, thesis_data

OF_FULL_SOLIDS = {"3.1", "3.2", "3.3", "A.4", "A.5"}


@pytest.fixture(scope="module")
def rows() -> list[frequencies.FrequencyRow]:
    """Without the tables that take many solutions of a solid, and without our coarse meshes."""
    with pytest.MonkeyPatch.context() as patch:
        for part in (frequencies._springs, frequencies._held_faces, frequencies._meshes):
            patch.delitem(frequencies._PARTS, part)
        return compared()


def compared() -> list[frequencies.FrequencyRow]:
    return frequencies.compared(load_hanger(HANGER_FILE), lambda label, fraction: None)


def test_tables_keep_their_marks(rows) -> None:
    assert frequencies.misses(rows) == []
    assert {row.table for row in rows} == set(frequencies.TABLES) - OF_FULL_SOLIDS


@pytest.mark.trial
def test_every_table_keeps_its_mark() -> None:
    every = compared()
    assert frequencies.misses(every) == []
    assert {row.table for row in every} == set(frequencies.TABLES)


def test_a_table_beyond_its_mark_is_named(rows) -> None:
    """A difference that is only stated is no miss; times stand next to the thesis's."""
    first = next(row for row in rows if row.table == "A.1")
    (miss,) = frequencies.misses([replace(first, difference_percent=0.31), rows[1]])
    assert miss == "table A.1, 711 kN: 0.31 % off, the mark is 0.3 %"
    (stated,) = [row for row in rows if row.table == "A.2" and row.condition == "711 kN"]
    assert stated.difference_percent > 2
    assert not stated.missed
    assert frequencies.cells(stated)[-1] == "stated"
    timed = replace(rows[0], seconds=1.23, thesis_time="4 to 125 s")
    assert frequencies.timed_cells(timed)[-2:] == ("1.2 s", "4 to 125 s")
    assert frequencies.timed_cells(rows[0])[-2:] == ("", "")


def test_fixed_ends_that_beat_springs_are_a_miss() -> None:
    evidence = {"beam1": -20.0, "beam2": -20.5, "solid0": -30.0, "solid1": -17.0, "solid2": -16.0}
    chosen = [
        selection.SelectionRow(
            printing, repeat, model, 0.2, value, 0.01, 0, 0, 711, 700, 720, 0, 0, {}, 711, 9
        )
        for printing in thesis_data.PRINTINGS
        for repeat in (1, 10)
        for model, value in evidence.items()
    ]
    assert selection.misses(chosen)[0] == "table 1.1, N_D = 1: beam1 beats beam2"
    assert len(selection.misses(chosen)) == 4


def test_a_tension_stands_beside_both_nominal_ones_and_the_time() -> None:
    row = selection.SelectionRow(
        "table A.4", 10, "beam2", 1, -53.6, 0.03, 0, -18.3, 802, 798, 841, 0.15, -0.04,
        {"theta_F": 1.2}, 711, 14.4,
    )  # fmt: skip
    by_head = dict(zip(selection.HEADS, selection.cells(row), strict=True))
    assert by_head["to 711 / 835 kN"] == "+13% / -4%"
    assert by_head["most probable, to 711 / 835 kN"] == "+20% / +2%"
    assert (by_head["time"], by_head["thesis, time"]) == ("14 s", "5 min")


def test_markdown_has_a_line_a_row(rows) -> None:
    lines = markdown(frequencies.HEADS, [frequencies.cells(row) for row in rows]).splitlines()
    assert len(lines) == len(rows) + 2
    assert {line.count("|") for line in lines} == {len(frequencies.HEADS) + 1}
