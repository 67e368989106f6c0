"""The state of a hanger and of a bridge in a word, and what is to be done: every way to each."""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import cache
from typing import Any

import numpy as np
import pytest

from shm.inference import UpdateOptions, update
from shm.models import DESCRIPTION, THESIS, build
from shm.report.bridge_report import tables
from shm.report.contents import BridgeReport, HangerReport
from shm.report.formatting import Interval
from shm.report.hanger_report import facts
from shm.report.hanger_status import (
    BridgeMessage,
    HangerMessage,
    Status,
    bridge_message,
    findings,
    status_of,
    still_detected,
)
from shm.report.hanger_summary import HangerSummary, LatestTest
from shm.report.open_warnings import nearly_slack, open_warnings, standing_out
from shm.report.states import states_over_time
from shm.values import (
    NAN,
    PLANES,
    Averaged,
    BaselineCheck,
    Change,
    Drift,
    FloatArray,
    MistakenMode,
    MistakenTest,
    ModalTest,
    Mode,
    RepeatedMistake,
    Summary,
    WatchedTest,
)
from shm.values.hanger import Limits
from shm.values.messages import Lead
from shm.values.posterior import DIAGNOSE
from shm.watch import Watched, WatchOptions, watch_hanger
from tests.helpers.hangers import HANGER_3
from tests.helpers.nouns import NOW, a_change, a_drift, a_watched_test, an_alert, averaged, with_now

HANGER = replace(HANGER_3, nominal_tension_n=700e3)
LIMITED = replace(HANGER, limits=Limits(900e3, 500e3))
NOTHING = "No action is needed before the next planned test."


def drift(probability: float = 0.01, shift: float = -0.004, sd: float = 0.004) -> Drift:
    return replace(a_drift(probability=probability), shift_mean=shift, shift_sd=sd)


def alert(*kinds: str, **changes: Any) -> Any:
    return replace(an_alert(), kinds=kinds, **changes)


def tension(mean_n: float, half_n: float = 10e3, **probabilities: float) -> Averaged:
    low, high = mean_n - half_n, mean_n + half_n
    return Averaged(Summary(mean_n, half_n / 1.645, low, mean_n, high), 5e3, **probabilities)


WARNED = {"warnings": ["It is new."]}
WATCHED = ("beyond threshold", "slow drift", "sudden change", "tests disagree", "gap", "held",
           "repeat the test")  # fmt: skip


@pytest.mark.parametrize(
    ("said", "status"),
    [
        ({}, Status.STEADY),
        ({"is_first": True}, Status.FIRST),
        *(({"drifts": [drift(p)]}, status) for p, status in (
            (0.949, Status.WATCH), (0.95, Status.ALERT), (0.5, Status.WATCH),
            (0.499, Status.STEADY), (math.nan, Status.STEADY))),
        ({"drifts": [drift(0.3), drift(0.96), drift(0.1)]}, Status.ALERT),
        ({"drifts": [drift(math.nan), drift(0.96)]}, Status.ALERT),
        ({"is_called": True}, Status.WATCH),
        ({"is_called": True, "is_first": True}, Status.WATCH),
        *(({"standing": [alert(kind)], "is_first": is_first}, status)
          for is_first in (True, False) for kind, status in (
              *((kind, Status.WATCH) for kind in WATCHED[1:]), ("beyond threshold", Status.ALERT),
              ("check the modes", Status.CHECK), ("check the baseline", Status.CHECK))),
        ({"standing": [alert()]}, Status.WATCH),  # what the row said is lost
        ({"standing": [alert()], "is_first": True}, Status.WATCH),
        ({"standing": [alert("check the modes", "check the baseline")]}, Status.CHECK),
        ({"standing": [alert("check the modes", "slow drift")]}, Status.WATCH),
        ({"standing": [alert("check the modes"), alert("held")]}, Status.WATCH),
        (WARNED, Status.CHECK),
        ({**WARNED, "is_first": True}, Status.CHECK),
        ({**WARNED, "drifts": [drift(0.6)]}, Status.WATCH),
        ({**WARNED, "drifts": [drift(0.99)]}, Status.ALERT),
        ({**WARNED, "drifts": [drift(0.99)], "is_first": True}, Status.ALERT),
    ],
)  # fmt: skip
def test_status_of_hanger(said: dict[str, Any], status: Status) -> None:
    known = {"drifts": [], "is_first": False, "is_called": False, **said}
    known["standing"] = findings([*known.get("standing", ()), alert("test")])  # a trial is nothing
    assert status_of(known.pop("drifts"), HANGER, **known) is status


def test_trials_of_a_hook_are_no_finding() -> None:
    found = [alert("test"), alert("held"), alert()]
    assert findings(found) == tuple(found[1:])


UNWATCHED = Lead("Hanger 3: not tested for 400 days.", "Repeat the hammer test within a week.")
QUIET = HangerSummary(HANGER, LatestTest("t2", NOW, tension(702e3)), drifts=[drift()])


def with_tension(tension: Averaged | None = None, **changes: Any) -> HangerSummary:
    """Return the quiet hanger with changes, its tension among them."""
    assert QUIET.latest is not None
    if tension is not None:
        changes["latest"] = replace(QUIET.latest, tension=tension)
    return replace(QUIET, **changes)


DETAILED = replace(HANGER, limits=Limits(math.nan, 5e5))
UNCOMPARED = "its latest test cannot be compared with the baseline."


@pytest.mark.parametrize(
    ("changes", "status", "state", "action"),
    [
        ({}, "STEADY", "no change detected since the baseline (tension -0.40 ± 0.66 %).", NOTHING),
        ({"is_first": True}, "FIRST", "tension 702 ± 10 kN, and no test after its baseline.",
         "No action is needed before the next planned test: choose a warmer or colder day for it, "
         "so that the baseline covers temperature."),
        ({"latest": None}, None, "no test yet.", "Test it at the next planned test."),
        ({"latest": None, "tests": 5}, None, "5 tests, no result yet.",
         "No action is needed: the daemon is at work, or waits for more tests for a baseline."),
        ({"unwatched": UNWATCHED}, "UNCLEAR", "not tested for 400 days.",
         "Repeat the hammer test within a week."),
        ({"drifts": []}, "UNCLEAR", UNCOMPARED,
         "Repeat the hammer test within a week: it lacks modes of the baseline."),
        ({"drifts": [drift(shift=math.nan)]}, "UNCLEAR", UNCOMPARED, None),
        ({"drifts": [drift(sd=math.inf)]}, "UNCLEAR", UNCOMPARED, None),
        ({"drifts": [drift(sd=0.0305)]}, "UNCLEAR",
         "no change detected, but its tests are too few or too imprecise to show one "
         "(tension -0.4 ± 5.0 %).",
         "Identify more modes at the next planned test, or test more often."),
        ({"drifts": [drift(sd=0.0303)]}, "STEADY", "no change detected since", NOTHING),
        ({"tension": tension(840e3)}, "CHECK", "tension is 20.0 ± 1.4 % above nominal.",
         "Compare it with the design at the next planned test, or give limits in bridge.toml."),
        ({"tension": tension(560e3)}, "CHECK", "tension is 20.0 ± 1.4 % below nominal.", None),
        ({"tension": tension(814e3)}, "STEADY", "no change detected", None),
        ({"tension": tension(816e3)}, "CHECK", "tension is 16.6 ± 1.4 % above nominal.", None),
        ({"tension": tension(586e3)}, "STEADY", "no change detected", None),
        ({"tension": tension(584e3)}, "CHECK", "tension is 16.6 ± 1.4 % below nominal.", None),
        ({"tension": tension(840e3), "hanger": LIMITED}, "STEADY", "no change detected", None),
        ({"tension": tension(560e3), "hanger": LIMITED}, "STEADY", "no change detected", None),
        ({"tension": tension(840e3), "hanger": DETAILED}, "CHECK",
         "tension is 20.0 ± 1.4 % above nominal.", None),
        ({"tension": tension(840e3), "hanger": replace(HANGER, nominal_tension_n=0.0)}, "STEADY",
         "no change detected", None),
        ({"tension": tension(480e3, probability_slack=0.51)}, "CHECK",
         "tension 480 ± 10 kN is probably below its lower limit.",
         "Repeat the hammer test today, and compare it with its design."),
        ({"tension": tension(920e3, probability_above_limit=0.51)}, "CHECK",
         "tension 920 ± 10 kN is probably above its upper limit.",
         "Repeat the hammer test within a week, and compare it with its design."),
        ({"tension": tension(702e3, probability_slack=0.5)}, "STEADY", "no change", NOTHING),
        ({"tension": tension(480e3, probability_slack=0.9), "unwatched": UNWATCHED}, "CHECK",
         "tension 480 ± 10 kN is probably below", None),
        ({"tension": tension(840e3), "unwatched": UNWATCHED}, "UNCLEAR", "not tested for 400 days.",
         None),
    ],
)  # fmt: skip
def test_message_of_a_quiet_hanger(
    changes: dict[str, Any], status: str | None, state: str, action: str | None
) -> None:
    message = with_tension(**changes, notes=("Ada looked.",)).message
    assert (message.status and message.status.name) == status
    assert message.lead.state.startswith(f"Hanger 3: {state}")
    if action is not None:
        assert message.lead.action == action
    assert message.notes == (("Ada looked.",) if status else ())


HELD = [alert("held", message="One is held. Look today."),
        alert("held", message="Another is held. Look within a week.")]  # fmt: skip
MODES = [alert("check the modes", message="Modes. Look within a week.")]


@pytest.mark.parametrize(
    ("changes", "status", "state"),
    [
        ({"drifts": [drift(0.97, -0.08, 0.01)]}, "ALERT", "tension"),
        ({"called": [a_change()]}, "WATCH", "tension"),
        ({"drifts": [drift(0.6, -0.045, 0.02), drift(0.2)]}, "WATCH",
         "tension fell by 4.5 ± 3.3 %, more likely than not beyond its threshold."),
        ({"standing": HELD}, "WATCH", "One is held."),
        ({"standing": [alert("slow drift", message="It creeps. Go today.")]}, "WATCH", "It c"),
        ({"warnings": ["It is new. Wait."], "standing": MODES}, "CHECK", "Modes."),
        ({"warnings": ["It is new. Wait.", "Another. Wait."]}, "CHECK", "It is new."),
    ],
)  # fmt: skip
def test_message_of_moved_hanger(changes: dict[str, Any], status: str, state: str) -> None:
    message = with_tension(**changes, notes=("Ada looked.",)).message
    assert message.status is Status[status]
    assert state in message.lead.state
    assert message.notes == ("Ada looked.",)


def test_an_alert_stays_as_sure_as_it_was_while_it_stands() -> None:
    """Of the latest test, or where the latest no longer reaches the threshold, its own number."""
    told = alert("beyond threshold", drifts=(drift(0.99, -0.08, 0.01),), test="t1")
    newest = drift(0.6, -0.06, 0.01)
    for now, standing, said in (
        (newest, told, "6.0 ± 1.6 %"),
        (replace(newest, shift_mean=-0.01), told, "8.0 ± 1.6 %"),
        (newest, replace(told, test="t2"), "8.0 ± 1.6 %"),
    ):
        assert said in with_tension(drifts=[now], standing=[standing]).message.lead.state


def test_a_diagnosis_replaces_the_advice_to_make_one() -> None:
    misses = f"beam1 misses the frequencies. Check the description{DIAGNOSE}."
    line = "Gap diagnosis of 2026-05-25: partly explained; the tension is 830 ± 140 kN."
    doubted = replace(tension(702e3), caveats=(misses,))
    assert with_tension(tension=doubted).message.reasons == (misses,)
    reasons = with_tension(tension=doubted, diagnosed=line).message.reasons
    assert reasons == ("beam1 misses the frequencies. Check the description.", line)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"tension": tension(702e3)}, "100.3 ± 1.4 %"),
        ({"tension": tension(702e3, 300e3)}, "not determined"),
        ({"hanger": replace(HANGER, nominal_tension_n=0.0)}, "no nominal"),
        ({"latest": None}, ""),
    ],
)
def test_of_nominal_reads_alike_in_every_table(changes: dict[str, Any], words: str) -> None:
    now = with_tension(**changes, is_first=True)
    assert now.of_nominal_words == words
    report = BridgeReport("Bridge", (now,), None, "", NOW, "1")
    table = next(each for each in tables(report) if each.title == "Hangers")
    assert table.rows[0][table.headings.index("of nominal")] == words


def test_a_detected_change_is_over_when_the_latest_test_shows_it() -> None:
    change = a_change()
    level = HANGER.thresholds.end_probability
    assert level == pytest.approx(0.475)
    latest = a_watched_test(probability=level)
    assert still_detected([change], latest, HANGER) == (change,)
    assert still_detected([change], None, HANGER) == (change,)
    assert still_detected([change], a_watched_test(probability=level - 1e-9), HANGER) == ()


def message(status: Status | None, action: str = NOTHING, **said: Any) -> HangerMessage:
    return HangerMessage(status, Lead("It is so.", action), **said)


def test_a_bridge_leads_with_its_most_urgent_hanger() -> None:
    """By urgency, then by the state; the others that need action are named by their numbers."""
    found = bridge_message(
        {
            1: message(Status.STEADY),
            2: message(Status.WATCH, "Test it within a week.", notes=("Ada looked.",)),
            3: message(Status.ALERT, "Test it within a week.", notes=("Ben looked.",)),
            4: message(Status.CHECK, "Look at the next planned test."),
            5: message(None, "Test it at the next planned test."),
        }
    )
    assert found.status is Status.ALERT
    assert found.notes == ("Ben looked.",)
    assert found.others == (
        "Other hangers that need action within a week: 2. At the next planned test: 4. "
        "Not tested yet: 5."
    )
    assert found.words == (
        "It is so. Test it within a week. Ben looked. Other hangers that need action within a "
        "week: 2. At the next planned test: 4. Not tested yet: 5."
    )
    assert found.document == {
        "status": "alert",
        "state": "It is so.",
        "action": "Test it within a week.",
        "urgency": "week",
        "notes": ["Ben looked."],
    }
    today = bridge_message(
        {1: message(Status.ALERT, "Look within a week."), 2: message(None, "Go today.")}
    )
    assert (today.urgency, today.status) == ("today", Status.ALERT)
    assert today.others == "Other hangers that need action within a week: 1."
    assert bridge_message({4: message(Status.UNCLEAR)}).others == ""


def test_a_quiet_bridge_says_so_and_what_is_untested() -> None:
    assert bridge_message({}) == BridgeMessage(
        None, Lead("No hanger has been tested yet.", "Test all at the next planned test.")
    )
    first, steady = message(Status.FIRST), message(Status.STEADY)
    for known, state in (
        ((first,), "1 hanger has a baseline only: no change can be judged yet."),
        ((first, first), "2 hangers have a baseline only: no change can be judged yet."),
        ((steady,), "No change detected on 1 hanger."),
        (
            (first, steady, steady),
            "No change detected on 2 hangers. "
            "1 hanger has a baseline only: no change can be judged yet.",
        ),
    ):
        quiet = bridge_message({**dict(enumerate(known)), 9: message(None)})
        assert quiet.lead == Lead(state, NOTHING)
        assert quiet.others == "Not tested yet: 9."
        assert quiet.document["status"] == ("steady" if steady in known else "first")
        assert quiet.urgency == "none"


def test_the_headline_names_every_hanger_whose_action_is_due() -> None:
    """Whatever its state: the same urgency that the table of hangers shows decides."""
    due = {
        2: message(Status.FIRST, "Identify more modes at the next planned test."),
        3: message(Status.UNCLEAR, "Identify more modes at the next planned test."),
        7: message(Status.ALERT, "Repeat the hammer test today."),
    }
    quiet = {1: message(Status.FIRST), 4: message(Status.STEADY)}
    found = bridge_message({**quiet, **due})
    assert found.lead == due[7].lead
    assert found.others == "Other hangers that need action at the next planned test: 2 and 3."
    assert bridge_message({**quiet, 2: due[2]}).lead == due[2].lead
    assert [id_ for id_, each in {**quiet, **due}.items() if each.needs_action] == [2, 3, 7]


def test_a_message_says_what_its_warnings_add_to_the_lead() -> None:
    one = message(Status.CHECK, "Wait.", notes=("Ada looked.",))
    assert one.words == "It is so. Wait. Ada looked."
    assert one.beyond_lead(["It is so. Wait. And more.", "It is so. Wait.", "Else."]) == (
        "And more.",
        "Else.",
    )
    assert [message(each).needs_action for each in (*Status, None)] == [
        True, True, True, True, False, False, False,
    ]  # fmt: skip
    assert message(None, "Go today.").needs_action
    assert one.document["notes"] == ["Ada looked."]
    assert message(None).document["status"] is None


@pytest.mark.parametrize(
    ("caveat", "state", "action"),
    [
        (
            "The sampler failed: 12 effective draws. Do not use this tension.",
            "do not use its",
            "`shm ingest --again t2 --from updated` within a week",
        ),
        ("It misses by 12 %. Do not use this tension.", "do not use its", "Check its description"),
        ("The evidence is wrong.", "its tension is in doubt", "at the next planned test"),
    ],
)
def test_hanger_message_tension_unusable(caveat: str, state: str, action: str) -> None:
    """No hanger is called unchanged, or beyond a limit, by a tension that must not be used."""
    doubtful = replace(tension(840e3), caveats=(caveat,))
    said = with_tension(doubtful).message
    assert said.status is Status.CHECK
    assert state in said.lead.state
    assert action in said.lead.action
    assert caveat in said.reasons


SINCE = datetime(2026, 5, 1, tzinfo=UTC)
MODE = MistakenMode("t1", "transverse", 2, 21.3, 14.2)


def share_of_nominal(share: float, half_width: float = 0.02) -> Summary:
    ends = share - half_width, share, share + half_width
    return Summary(*(each * HANGER_3.nominal_tension_n for each in (share, 0.01, *ends)))


def latest(mistaken: tuple[RepeatedMistake, ...] = (), **of_change: Any) -> WatchedTest:
    """Return a test whose change is far from being called, but for what is given."""
    given = {"evidence_years": 1.0, "limit_years": 100.0, "probability": 0.01, "sudden": 0.5,
             "began_after": SINCE, "began_by": SINCE, "moved": ()}  # fmt: skip
    return WatchedTest("t9", SINCE, 10.0, (), Change(**{**given, **of_change}), mistaken=mistaken)


def row(*shares: float, families: str = "") -> str:
    """Return the warning about the third of hangers with such relative tensions."""
    families = families or "a" * len(shares)
    hangers = [replace(HANGER_3, id=n, family=f) for n, f in enumerate(families)]
    return standing_out(
        hangers[2], hangers, {n: share_of_nominal(each) for n, each in enumerate(shares)}
    )


@pytest.mark.parametrize(
    ("now", "is_reported", "is_said"),
    [
        (0.03, False, True),
        (0.03, True, False),  # the alert says it
        (0.6, False, False),
        (0.49, False, False),  # its interval reaches beyond half
    ],
)
def test_nearly_slack_is_said_first(now: float, is_reported: bool, is_said: bool) -> None:
    said = nearly_slack(
        HANGER_3, share_of_nominal(1.0), share_of_nominal(now), is_reported=is_reported
    )
    assert bool(said) is is_said
    if is_said:
        assert said.startswith("Hanger 3 carries 3.0 ± 2.0 % of its nominal tension by its latest")
        assert len(said.split(":")[0].split()) <= 25
        assert "today" in said
        assert open_warnings(HANGER_3, None, now=(said,)) == (said,)


@pytest.mark.parametrize(
    ("check", "said"),
    [
        (BaselineCheck(misfit="5 of 12 modes fit nothing"), "Why: 5 of 12 modes fit nothing."),
        (BaselineCheck(tests=(MistakenTest("t4", "a wrong clock"),)),
         "without test t4. Find out within a week"),
    ],
)  # fmt: skip
def test_baseline_that_does_not_fit_is_a_warning(check: BaselineCheck, said: str) -> None:
    """A mode left out of a baseline that fits is none."""
    (warning,) = open_warnings(HANGER_3, check)
    assert warning.startswith("Hanger 3: its baseline ")
    assert said in warning
    for sound in (BaselineCheck(modes=(MODE,)), BaselineCheck(), None):
        assert open_warnings(HANGER_3, sound) == ()


def test_a_mode_is_a_warning_from_the_third_test_on_that_has_it_wrong() -> None:
    twice = RepeatedMistake("transverse", 3, SINCE, 2)
    assert open_warnings(HANGER_3, None, latest=latest(mistaken=(twice,))) == ()
    (warning,) = open_warnings(HANGER_3, None, latest=latest(mistaken=(replace(twice, tests=3),)))
    assert warning == (
        "Hanger 3: transverse 3 has not fitted the other modes since 2026-05-01. Check its number "
        "at the next planned test."
    )


def test_a_baseline_that_stands_alone_is_a_warning() -> None:
    assert open_warnings(HANGER_3, None, latest=latest(against_baseline=2)) == ()
    (warning,) = open_warnings(HANGER_3, None, latest=latest(against_baseline=6))
    assert "the 6 tests since the baseline agree with each other" in warning
    called = latest(against_baseline=6, evidence_years=1e4)
    assert open_warnings(HANGER_3, None, latest=called) == (), "it is told as a change"


def test_tension_far_off_stands_out_beside_neighbours_that_are_not() -> None:
    assert "% above nominal, unlike its neighbours" in row(1.05, 0.97, 1.41, 1.0, 1.02)
    assert "% below nominal, unlike its neighbours" in row(1.05, 0.97, 0.62, 1.0, 1.02)
    assert row(1.05, 0.97, 1.2, 1.0, 1.02) == ""
    assert row(1.4, 1.5, 1.41, 1.38, 1.45) == "", "all are off: the nominal tensions are"
    assert row(1.05, 0.97, 1.41, 1.0, families="abaa") != ""
    assert row(1.05, 0.97, 1.41, 1.0, families="bbab") == "", "none is of its kind"
    hangers = [replace(HANGER_3, id=n) for n in range(4)]
    known = {0: share_of_nominal(1.0), 1: share_of_nominal(1.02), 3: share_of_nominal(0.98)}
    assert standing_out(hangers[2], hangers, {**known, 2: share_of_nominal(1.4)}) != ""
    assert standing_out(hangers[2], hangers, {**known, 2: share_of_nominal(1.4, 0.3)}) == ""
    assert standing_out(hangers[2], hangers, known) == ""


BEGIN = datetime(2026, 1, 5, tzinfo=UTC)
# In percent of each mode: what no tension and no end stiffness does.
OTHER_BAR = np.array([[4, -4, 4, -4, 4, -4], [-4, 4, -4, 4, -4, 4]])


def modal_test(number: int, off_percent: FloatArray) -> ModalTest:
    theta = np.array([(1.0, 1.0, 7.3, 7.1, 7.2, 7.4)])
    hz = build("beam2", HANGER_3, THESIS).frequencies_hz(theta, 6)[0] * (1 + off_percent / 100)
    modes = tuple(
        Mode(plane, order, float(value), float(value) * 2e-4)
        for plane, row in zip(PLANES, hz, strict=True)
        for order, value in enumerate(row, start=1)
    )
    time = BEGIN + timedelta(weeks=2 * number)
    return ModalTest(f"t{number}", modes, 3, time, temperature_c=10.0)


@cache
def watched() -> Watched:
    """One test of the baseline, and one of another bar."""
    first, other = modal_test(0, np.zeros((2, 6))), modal_test(1, OTHER_BAR)
    baseline = update(
        [first], build("beam2", HANGER_3, DESCRIPTION), UpdateOptions(samples=300, seed=1)
    )
    of_first, of_other = [(first, BEGIN)], [(other, BEGIN + timedelta(weeks=2))]
    return watch_hanger(baseline, of_first, of_other, HANGER_3, WatchOptions())


def test_unexplained_test_has_no_shift_and_no_state() -> None:
    """But a loss that is probable is reported although the modes fit no state."""
    latest = watched().latest
    assert not latest.change.called
    assert all(math.isnan(each.shift_mean) for each in latest.published_drifts)
    assert all(math.isnan(each.probability) for each in latest.published_drifts)
    latest = watched().latest
    drifts = tuple(replace(each, probability=0.9) for each in latest.drifts)
    probable = replace(latest, drifts=drifts)
    assert probable.is_unexplained
    assert probable.published_drifts == drifts
    states = states_over_time(watched(), HANGER_3)
    (tension,) = (each for each in states.quantities if each.is_tension)
    for band in (tension.read, tension.filtered, tension.smoothed):
        assert np.isfinite(band.middle).tolist() == [True, False]


def test_unexplained_test_is_doubted_and_gives_no_shift(season: HangerReport) -> None:
    latest = watched().latest
    warnings = open_warnings(HANGER_3, None, latest=latest)
    tension = averaged(Interval.normal(711e3, 5e3))
    of_test = LatestTest(latest.test, BEGIN, tension)
    message = HangerSummary(
        HANGER_3, of_test, drifts=latest.published_drifts, warnings=warnings
    ).message
    assert message.status is Status.CHECK
    assert message.urgency == "week"
    assert "explains its latest test" in message.words
    drifts = tuple(replace(each, shift_mean=NAN, probability=NAN) for each in season.drifts)
    unknown = replace(with_now(season, drifts=drifts, standing=()), alerts=())
    assert unknown.now.change is None
    values = {what: value for what, value, _ in facts(unknown)}
    assert values["Since the baseline"] == "not known"
