"""Every check leaves a plain test alone, and what it says is made for a person to read."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import UTC, date, datetime, timedelta

import numpy as np
import pytest

from shm.plausibility import CHECKS, Candidate, Check, doubts_about, implied_shift, notice_of
from shm.values import Doubt, Fingerprint, KnownSamples
from shm.values.messages import Lead
from tests.helpers.hangers import HANGER_3
from tests.helpers.workspaces import START, modelled_test

DAY = timedelta(days=1)
PRINT = Fingerprint("0" * 64, np.eye(2, 256))
PLAIN = Candidate(
    hanger=HANGER_3,
    test=modelled_test("t", HANGER_3, day=3),
    received_at=START + 4 * DAY,
    tolerance=DAY,
    modified_at=START + 4 * DAY,
    built=date(1990, 1, 1),
    file_times=[START + 3 * DAY],
    reference=[modelled_test("b", HANGER_3)],
    reference_at=START,
    fingerprint=PRINT,
    copies=[KnownSamples("a.csv", 3, Fingerprint("1" * 64, np.eye(3, 256, 5)))],
)
HALVED = tuple(
    replace(m, frequency_hz=m.frequency_hz / 2, frequency_sd_hz=m.frequency_sd_hz / 2)
    for m in PLAIN.test.modes
)
DOUBTED = {
    "clock before the bridge": {"test": replace(PLAIN.test, time=datetime(1970, 1, 1, tzinfo=UTC))},
    "clock ahead": {"received_at": START + DAY},
    "clock ambiguous": {
        "test": replace(PLAIN.test, time=None),
        "possible_times": [START - 30 * DAY, START + 3 * DAY],
    },
    "clock scattered": {"file_times": [START, START + 3 * DAY]},
    "clock stuck": {"same_time": [modelled_test("other", HANGER_3, 3, 1.1)]},
    "clock before the baseline": {
        "reference": [modelled_test("b", HANGER_3, tension=1.1)],
        "reference_at": START + 5 * DAY,
    },
    "right time base": {"test": replace(PLAIN.test, modes=HALVED), "earlier": PLAIN.reference},
    "right signals": {"signals": ["acc_1 moves as 7 g would: right unit?"]},
    "copy": {"copies": [KnownSamples("a.csv (recording 1)", 4, PRINT)]},
}


SHIFTED = ("clock before the baseline", "right time base")
"""Where the modes are those of another tension, if they are the hanger's own."""


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_a_check_has_no_doubt_of_a_plain_test_nor_where_nothing_is_known(check: Check) -> None:
    assert check(PLAIN) is None
    bare = replace(PLAIN.test, time=None)
    assert check(Candidate(HANGER_3, bare, START, DAY)) is None


@pytest.mark.parametrize("check", DOUBTED)
def test_a_doubt_says_what_is_the_matter_what_to_do_and_why(check: str) -> None:
    candidate = replace(PLAIN, **DOUBTED[check])  # type: ignore[arg-type]
    doubts = doubts_about(candidate)
    assert [doubt.check for doubt in doubts] == [check]
    (doubt,) = doubts
    assert doubt.why.endswith(".")
    assert not doubt.state.endswith(".")
    assert not doubt.action.endswith(".")
    message = notice_of(candidate, doubts, 12, [])
    for part in (doubt.state, doubt.action[1:], doubt.why, "--confirm 12", "--discard 12"):
        assert part in message
    assert ("repeat the test today" in message.lower()) is (check in SHIFTED)
    assert (Lead.of(message).urgency == "today") is (check in SHIFTED)
    assert len(re.split(r"[.?] ", message, maxsplit=1)[0].split()) <= 25


@pytest.mark.parametrize("check", ["right hanger", "right planes"])
def test_who_may_discard_a_test_of_another_bar_is_told_that_the_hanger_may_be_damaged(
    check: str,
) -> None:
    # Its tension is as it was: the modes fit the hanger no more for another reason.
    doubt = Doubt(
        check, "the modes fit hanger 4: right hanger?", "Drop it again", "Probability 0.9."
    )
    message = notice_of(PLAIN, [doubt], 12, [])
    assert "If it is of hanger 3 after all, it has changed and may be damaged" in message
    assert "look at it before you discard the test" in message
    copied = replace(doubt, check="copy")
    assert "damaged" not in notice_of(PLAIN, [copied], 12, [])


@pytest.mark.parametrize(("share", "moved"), [(0.85, "has lost 1"), (1.15, "has gained 1")])
def test_which_way_the_tension_would_have_gone_is_said(share: float, moved: str) -> None:
    moved_test = replace(PLAIN, test=modelled_test("t", HANGER_3, 0, share))
    doubt = Doubt("right hanger", "the modes fit hanger 4: right hanger?", "Drop it", "Why.")
    assert f"hanger 3 {moved}" in notice_of(moved_test, [doubt], 12, [])


def test_a_loss_is_a_loss_though_stiffer_ends_lift_the_high_modes() -> None:
    stiffer = replace(HANGER_3, elastic_modulus_pa=1.08 * HANGER_3.elastic_modulus_pa)
    test = modelled_test("t", stiffer, 0, 0.93)
    lowest, *_, highest = (
        each.frequency_hz / before.frequency_hz - 1
        for each, before in zip(test.modes[:6], PLAIN.test.modes, strict=False)
    )
    assert 0 < lowest < highest  # a tension alone would have to rise for that
    assert implied_shift(test, PLAIN.reference, HANGER_3) == pytest.approx(-0.07, rel=0.1)
    doubt = Doubt("clock ahead", "its time cannot be", "Set it", "Why.")
    said = notice_of(replace(PLAIN, test=test), [doubt], 1, [])
    assert "may have lost 7 % of its tension" in said
