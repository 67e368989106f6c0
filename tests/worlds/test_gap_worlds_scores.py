"""The scores of the benchmark on hangers with a known gap cause, on diagnoses made up here."""

from typing import Any

import pytest

from tests.benchmarks.gap_worlds import (
    format_case,
    is_given,
    is_inherent,
    is_right,
    is_sure_and_wrong,
    is_wrong,
    score,
)


def make_row(
    leading: str, *, causes: tuple[str, ...] = ("point_mass",), without: bool = False, **other: Any
) -> dict[str, Any]:
    names = leading.split(" + ") if leading else []
    planted = [{"cause": name, "accepted": [name], "size": 1.0, "visible": 9.0} for name in causes]
    tension = {"mean": 101.0, "sd": 1.0, "q025": 99.0, "q975": 103.0}
    row = {
        "index": 0,
        "without": without,
        "truth": {
            "tension_n": 100.0,
            "causes": planted,
            "inherent": {"sag": 4.0},
            "kind": "bar",
            "xi": 9.0,
            "tests": 2,
            "counts": [5, 5],
            "shapes": False,
        },
        "accepted": sorted(causes),
        "leads": "cause" if leading else "no gap",
        "leading": names,
        "leading_at": "",
        "claim": 0.95 if leading else 0.0,
        "group": names,
        "no_gap": 0.01,
        "unexplained": 0.02,
        "before": {**tension, "mean": 110.0},
        "after": tension,
        "seconds": 3.0,
    }
    return row | other


@pytest.mark.parametrize(
    ("row", "right", "inherent", "wrong"),
    [
        (make_row("point_mass"), True, False, False),
        (make_row("point_mass + timebase"), True, False, False),
        (make_row("timebase", group=["point_mass", "timebase"]), True, False, False),
        (make_row("timebase"), False, False, True),
        (make_row("sag"), False, True, False),
        (make_row(""), False, False, False),
        (make_row("timebase", causes=()), False, False, True),
        (make_row("point_mass", without=True), False, False, True),
    ],
)
def test_is_right_inherent_wrong(
    row: dict[str, Any], right: bool, inherent: bool, wrong: bool
) -> None:
    assert (is_right(row), is_inherent(row), is_wrong(row)) == (right, inherent, wrong)
    assert is_sure_and_wrong(row) == wrong
    assert not is_sure_and_wrong(row | {"claim": 0.7})


def test_is_given_needs_the_leading_cause() -> None:
    row = make_row("timebase", group=["point_mass", "timebase"])
    assert not is_given(row, row["accepted"])
    assert is_given(make_row("point_mass + sag"), ["point_mass"])


def test_score_counts() -> None:
    rows = [
        *(make_row("point_mass"), make_row("timebase"), make_row(""), make_row("", causes=())),
        make_row("point_mass", causes=("point_mass", "timebase")),
        make_row("timebase", without=True),
        {"index": 9, "without": False, "truth": {}, "refused": "no", "seconds": 1.0},
    ]
    lines = dict(line.strip("| ").split(" | ") for line in score(rows).splitlines()[2:])
    assert lines["refused"] == "1 of 7"
    assert lines["sound: a gap claimed"].startswith("0 of 1")
    assert lines["one cause: given first"].startswith("1 of 3")
    assert lines["one cause: wrong"].startswith("1 of 3")
    assert lines["one cause: no gap"].startswith("1 of 3")
    assert lines["pair: one of both in leading group"].startswith("1 of 1")
    assert lines["pair: both in leading group"].startswith("0 of 1")
    assert lines["... of cause left out"] == "1 of 1: 1.00 (0.05 to 1.00)"
    assert lines["tension error before, median"].startswith("10.00%")
    assert lines["tension error after, median"].startswith("1.00%")


def test_format_case_verdict() -> None:
    assert "wrong: timebase" in format_case(make_row("timebase"))
    assert "NOT COVERED" in format_case(
        make_row("", after={"mean": 90.0, "sd": 1.0, "q025": 88.0, "q975": 92.0})
    )
