"""The state of a hanger and of a bridge in a word, and what is to be done: every way to each."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

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
from shm.values import Averaged, Drift, Summary
from shm.values.hanger import Limits
from shm.values.messages import Lead
from tests.helpers.hangers import HANGER_3
from tests.helpers.nouns import NOW, a_change, a_drift, a_watched_test, an_alert

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


@pytest.mark.parametrize(
    ("said", "status"),
    [
        ({}, Status.STEADY),
        ({"is_first": True}, Status.FIRST),
        ({"drifts": [drift(0.949)]}, Status.WATCH),
        ({"drifts": [drift(0.95)]}, Status.ALERT),
        ({"drifts": [drift(0.5)]}, Status.WATCH),
        ({"drifts": [drift(0.499)]}, Status.STEADY),
        ({"drifts": [drift(0.3), drift(0.96), drift(0.1)]}, Status.ALERT),
        ({"drifts": [drift(math.nan), drift(0.96)]}, Status.ALERT),
        ({"drifts": [drift(math.nan)]}, Status.STEADY),
        ({"is_called": True}, Status.WATCH),
        ({"is_called": True, "is_first": True}, Status.WATCH),
        ({"standing": [alert("beyond threshold")]}, Status.ALERT),
        ({"standing": [alert("slow drift")]}, Status.WATCH),
        ({"standing": [alert()]}, Status.WATCH),
        ({"standing": [alert("check the modes")]}, Status.CHECK),
        ({"standing": [alert("check the modes", "check the baseline")]}, Status.CHECK),
        ({"standing": [alert("check the modes", "slow drift")]}, Status.WATCH),
        ({"standing": [alert("check the modes"), alert("held")]}, Status.WATCH),
        ({"warnings": ["It is new."]}, Status.CHECK),
        ({"warnings": ["It is new."], "is_first": True}, Status.CHECK),
        ({"warnings": ["It is new."], "drifts": [drift(0.6)]}, Status.WATCH),
    ],
)
def test_the_state_in_a_word(said: dict[str, Any], status: Status) -> None:
    known = {"drifts": [], "is_first": False, "is_called": False, **said}
    assert status_of(known.pop("drifts"), HANGER, **known) is status


UNWATCHED = Lead("Hanger 3: not tested for 400 days.", "Repeat the hammer test within a week.")
QUIET = HangerSummary(HANGER, LatestTest("t2", NOW, tension(702e3)), drifts=[drift()])


def with_tension(tension: Averaged | None = None, **changes: Any) -> HangerSummary:
    """Return the quiet hanger with changes, its tension among them."""
    assert QUIET.latest is not None
    if tension is not None:
        changes["latest"] = replace(QUIET.latest, tension=tension)
    return replace(QUIET, **changes)


@pytest.mark.parametrize(
    ("changes", "status", "state", "action"),
    [
        ({}, "STEADY", "no change detected since the baseline (tension -0.40 ± 0.66 %).", NOTHING),
        (
            {"is_first": True},
            "FIRST",
            "tension 702 ± 10 kN, and no test after its baseline.",
            "Choose a warmer or colder day at the next planned test, so that the baseline covers "
            "temperature.",
        ),
        ({"latest": None}, None, "no test yet.", "Test it at the next planned test."),
        (
            {"latest": None, "tests": 5},
            None,
            "5 tests, no result yet.",
            "No action is needed: the daemon is at work, or waits for more tests for a baseline.",
        ),
        (
            {"unwatched": UNWATCHED},
            "UNCLEAR",
            "not tested for 400 days.",
            "Repeat the hammer test within a week.",
        ),
        (
            {"drifts": []},
            "UNCLEAR",
            "its latest test cannot be compared with the baseline.",
            "Repeat the hammer test within a week: it lacks modes of the baseline.",
        ),
        ({"drifts": [drift(shift=math.nan)]}, "UNCLEAR", "its latest test cannot be", None),
        ({"drifts": [drift(sd=math.inf)]}, "UNCLEAR", "its latest test cannot be", None),
        (
            {"drifts": [drift(sd=0.0305)]},
            "UNCLEAR",
            "no change detected, but its tests are too few or too rough to show one "
            "(tension -0.4 ± 5.0 %).",
            "Identify more modes at the next planned test, or test more often.",
        ),
        ({"drifts": [drift(sd=0.0303)]}, "STEADY", "no change detected since", NOTHING),
        (
            {"tension": tension(840e3)},
            "CHECK",
            "tension is 20.0 ± 1.4 % above nominal.",
            "Compare it with the design at the next planned test, or give limits in bridge.toml.",
        ),
        ({"tension": tension(560e3)}, "CHECK", "tension is 20.0 ± 1.4 % below nominal.", None),
        ({"tension": tension(814e3)}, "STEADY", "no change detected", None),
        ({"tension": tension(816e3)}, "CHECK", "tension is 16.6 ± 1.4 % above nominal.", None),
        ({"tension": tension(586e3)}, "STEADY", "no change detected", None),
        ({"tension": tension(584e3)}, "CHECK", "tension is 16.6 ± 1.4 % below nominal.", None),
        ({"tension": tension(840e3), "hanger": LIMITED}, "STEADY", "no change detected", None),
        ({"tension": tension(560e3), "hanger": LIMITED}, "STEADY", "no change detected", None),
        (
            {"tension": tension(840e3), "hanger": replace(HANGER, limits=Limits(math.nan, 5e5))},
            "CHECK",
            "tension is 20.0 ± 1.4 % above nominal.",
            None,
        ),
        (
            {"tension": tension(840e3), "hanger": replace(HANGER, nominal_tension_n=0.0)},
            "STEADY",
            "no change detected",
            None,
        ),
        (
            {"tension": tension(480e3, probability_slack=0.51)},
            "CHECK",
            "tension 480 ± 10 kN is probably below its lower limit.",
            "Repeat the hammer test today, and compare it with its design.",
        ),
        (
            {"tension": tension(920e3, probability_above_limit=0.51)},
            "CHECK",
            "tension 920 ± 10 kN is probably above its upper limit.",
            "Repeat the hammer test within a week, and compare it with its design.",
        ),
        ({"tension": tension(702e3, probability_slack=0.5)}, "STEADY", "no change", NOTHING),
        (
            {
                "tension": tension(480e3, probability_slack=0.9),
                "unwatched": UNWATCHED,
            },
            "CHECK",
            "tension 480 ± 10 kN is probably below",
            None,
        ),
        (
            {"tension": tension(840e3), "unwatched": UNWATCHED},
            "UNCLEAR",
            "not tested for 400 days.",
            None,
        ),
    ],
)  # fmt: skip
def test_of_a_quiet_hanger_what_its_tests_can_say(
    changes: dict[str, Any], status: str | None, state: str, action: str | None
) -> None:
    message = with_tension(**changes, notes=("Ada looked.",)).message
    assert (message.status and message.status.name) == status
    assert message.lead.state.startswith(f"Hanger 3: {state}")
    if action is not None:
        assert message.lead.action == action
    assert message.notes == (("Ada looked.",) if status else ())


@pytest.mark.parametrize(
    ("changes", "status", "state"),
    [
        ({"drifts": [drift(0.97, -0.08, 0.01)]}, "ALERT", "tension"),
        ({"called": [a_change()]}, "WATCH", "tension"),
        (
            {"drifts": [drift(0.6, -0.045, 0.02), drift(0.2)]},
            "WATCH",
            "tension fell by 4.5 ± 3.3 %, more likely than not beyond its threshold.",
        ),
        (
            {"standing": [alert("held", message="One is held. Look today."),
                          alert("held", message="Another is held. Look within a week.")]},
            "WATCH",
            "One is held.",
        ),
        ({"standing": [alert("slow drift", message="It creeps. Go today.")]}, "WATCH", "It c"),
        (
            {"warnings": ["It is new. Wait."],
             "standing": [alert("check the modes", message="Modes. Look within a week.")]},
            "CHECK",
            "Modes.",
        ),
        ({"warnings": ["It is new. Wait.", "Another. Wait."]}, "CHECK", "It is new."),
    ],
)  # fmt: skip
def test_of_a_hanger_that_moved_the_most_urgent_is_said(
    changes: dict[str, Any], status: str, state: str
) -> None:
    message = with_tension(**changes, notes=("Ada looked.",)).message
    assert message.status is Status[status]
    assert state in message.lead.state
    assert message.notes == ("Ada looked.",)


def test_an_alert_stays_as_sure_as_it_was_while_it_stands() -> None:
    """Of the latest test, or where the latest no longer reaches the threshold, its own number."""
    told = alert("beyond threshold", drifts=(drift(0.99, -0.08, 0.01),), test="t1")
    newest = drift(0.6, -0.06, 0.01)
    said = with_tension(drifts=[newest], standing=[told]).message.lead.state
    assert "6.0 ± 1.6 %" in said
    small = replace(newest, shift_mean=-0.01)
    said = with_tension(drifts=[small], standing=[told]).message.lead.state
    assert "8.0 ± 1.6 %" in said
    own = replace(told, test="t2")
    said = with_tension(drifts=[newest], standing=[own]).message.lead.state
    assert "8.0 ± 1.6 %" in said


def test_a_detected_change_is_over_when_the_latest_test_shows_it() -> None:
    change = a_change()
    level = HANGER.thresholds.end_probability
    assert level == pytest.approx(0.475)
    latest = a_watched_test(probability=level)
    assert still_detected([change], latest, HANGER) == (change,)
    assert still_detected([change], None, HANGER) == (change,)
    assert still_detected([change], a_watched_test(probability=level - 1e-9), HANGER) == ()


def test_trials_of_a_hook_are_no_finding() -> None:
    found = [alert("test"), alert("held"), alert()]
    assert findings(found) == tuple(found[1:])


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
        "Other hangers that need action within a week: 2. At the next planned test: 4."
    )
    assert found.words == (
        "It is so. Test it within a week. Ben looked. Other hangers that need action within a "
        "week: 2. At the next planned test: 4."
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
    quiet = bridge_message({1: message(Status.FIRST), 2: message(Status.STEADY), 3: message(None)})
    assert (quiet.status, quiet.others) == (Status.STEADY, "Not tested yet: 3.")
    assert quiet.lead == Lead("No change detected on 2 hangers.", NOTHING)
    assert quiet.document["status"] == "steady"
    assert quiet.urgency == "none"


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
