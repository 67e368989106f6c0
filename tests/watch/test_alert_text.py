"""When an alert is raised, when it is not raised again, and what it says."""

from __future__ import annotations

from dataclasses import asdict, replace
from datetime import UTC, datetime, timedelta

import pytest

from shm.values import (
    Alert,
    Change,
    Drift,
    MonitoredHanger,
    Moved,
    Thresholds,
    WatchedTest,
)
from shm.values.messages import Lead
from shm.watch.watching import replay
from shm.watch.words.alert_text import shift_words
from shm.watch.words.notices import message_of_odd
from tests.helpers.hangers import HANGER_3
from tests.helpers.nouns import a_drift, a_watched_test

START = datetime(2026, 5, 1, tzinfo=UTC)
FELL = Moved("tension", 0.97, -0.082, 0.0067)
DECK = Moved("log10_k1", 0.55, -0.3, 0.06, "deck", "transverse", ("log10_k3",))
ARCH = Moved("log10_k3", 0.40, -0.31, 0.06, "arch", "transverse", ("log10_k1",))


def change(
    *, called: bool = False, began: float = 0.0, probability: float = 0.9, **changes: object
) -> Change:
    values: dict[str, object] = {
        "evidence_years": 500.0 if called else 1.0,
        "limit_years": 200.0,
        "probability": probability,
        "sudden": 0.98,
        "began_after": START + timedelta(days=began - 3),
        "began_by": START + timedelta(days=began),
        "moved": (FELL,),
        "outlier_probability": 0.01,
        **changes,
    }
    return Change(**values)  # type: ignore[arg-type]


def drift(test: str, probability: float, quantity: str = "tension", shift: float = -0.08) -> Drift:
    limit = 0.05 if quantity == "tension" else 0.5
    baseline, value = (711e3, 711e3 * (1 + shift)) if quantity == "tension" else (7.0, 7.0 + shift)
    sd = abs(shift) / (10 if probability >= 0.7 else 3)
    return Drift(3, test, START, quantity, baseline, value, shift, sd, limit, probability)


def day(
    number: int, said: Change | None = None, probability: float = 0.0, **shifts: float
) -> WatchedTest:
    """The test of a day: tension beyond its threshold with a probability, springs by name."""
    name = f"t{number}"
    drifts = [drift(name, probability, **shifts)]  # type: ignore[arg-type]
    said = said or change()
    return WatchedTest(name, START + timedelta(days=number), 11.0, tuple(drifts), said)


def told(*watched: WatchedTest) -> list[tuple[str, tuple[str, ...]]]:
    return [(alert.test, alert.kinds) for alert in replay(watched, HANGER_3)[1]]


def only(*watched: WatchedTest) -> Alert:
    (alert,) = replay(watched, HANGER_3)[1]
    return alert


# ---------------------------------------------------------------- when


def test_a_called_loss_that_is_clearly_beyond_its_threshold_asks_for_today_at_once() -> None:
    """A call says that something changed: what is beyond then need not wait for a further test."""
    message = only(day(1), day(2, change(called=True), probability=0.7)).message
    assert "beyond its threshold. Repeat the hammer test today" in message
    assert "The probability that tension is beyond its threshold of 5 % is 0.97." in message


@pytest.mark.parametrize(("sudden", "kind"), [(0.98, "sudden change"), (0.2, "slow drift")])
def test_a_called_change_is_sudden_or_slow_by_the_likelier(sudden: float, kind: str) -> None:
    assert told(day(1), day(2, change(called=True, sudden=sudden))) == [("t2", (kind,))]


def test_a_call_that_flickers_about_its_limit_is_told_once() -> None:
    calls = [day(n, change(called=called, began=2)) for n, called in enumerate((1, 0, 1), start=2)]  # type: ignore[arg-type]
    assert told(*calls) == [("t2", ("sudden change",))]


def test_a_further_change_after_the_alert_is_another() -> None:
    first, second = change(called=True, began=2), change(called=True, began=9)
    assert told(day(2, first), day(3), day(10, second)) == [
        ("t2", ("sudden change",)),
        ("t10", ("sudden change",)),
    ]


def test_a_probability_that_hovers_about_the_level_rings_once() -> None:
    hovering = [day(n, probability=p) for n, p in enumerate((0.96, 0.93, 0.97, 0.5, 0.99))]
    assert told(*hovering) == [("t0", ("beyond threshold",))]


def test_a_condition_that_ended_below_half_the_level_can_ring_anew() -> None:
    again = [day(2 * n, probability=p) for n, p in enumerate((0.96, 0.47, 0.46, 0.94, 0.96))]
    assert [name for name, _ in told(*again)] == ["t0", "t8"]


@pytest.mark.parametrize(
    "days", [{0: 0.96, 4: 0.1, 8: 0.97}, {0: 0.96, 4: 0.1, 5: 0.1, 8: 0.97}], ids=["one", "two"]
)
def test_one_visit_ends_nothing_that_was_told(days: dict[int, float]) -> None:
    """A van that unloads a hanger for a day: the loss that stands beneath it rings no second time,
    and its alert stays."""
    assert [name for name, _ in told(*(day(n, probability=p) for n, p in days.items()))] == ["t0"]


def test_the_level_and_its_half_are_those_of_the_hanger() -> None:
    careful = replace(HANGER_3, thresholds=Thresholds(alert_probability=0.6))
    chances = enumerate((0.6, 0.31, 0.31, 0.7, 0.29, 0.29, 0.7))
    watched = [day(2 * n, probability=p) for n, p in chances]
    assert [alert.test for alert in replay(watched, careful)[1]] == ["t0", "t12"]


def test_a_called_change_that_passes_the_threshold_is_told_again() -> None:
    called = change(called=True, began=2)
    assert told(day(2, called), day(3, called, 0.5), day(4, called, 0.97)) == [
        ("t2", ("sudden change",)),
        ("t4", ("beyond threshold",)),
    ]


def test_a_call_of_another_quantity_than_the_one_beyond_is_told() -> None:
    other = change(called=True, began=2, moved=(DECK, ARCH))
    assert told(day(2, probability=0.97), day(3, other, 0.97)) == [
        ("t2", ("beyond threshold",)),
        ("t3", ("sudden change",)),
    ]


# ---------------------------------------------------------------- the same alert


def test_the_key_names_hanger_rules_quantity_way_and_test() -> None:
    assert only(day(2, change(called=True))).key == "hanger-3:sudden-change:tension-down:t2"
    both = only(day(2, change(called=True, moved=(DECK, ARCH)), 0.99))
    assert both.key == "hanger-3:beyond-threshold+sudden-change:tension-down:t2"


# ---------------------------------------------------------------- what it says


def test_a_sudden_loss_says_the_state_then_what_to_do_then_why() -> None:
    message = only(day(2, change(called=True, began=2), 0.3)).message
    assert message == (
        "Hanger 3: tension fell by 8.2 ± 1.1 %. Repeat the hammer test within a week; if the loss "
        "stays, inspect its anchorages and the rod, and compare the hangers beside it (`shm drift "
        "bridge`). It came suddenly, between 2026-04-30 and 2026-05-03. Details: ± is half "
        "the 90 % interval. The probability of any change, which allows for disturbed visits, is "
        "0.90. The mean time between false alarms is at least 200 years."
    )


@pytest.mark.parametrize(
    ("cause", "state", "action"),
    [
        ("point_mass", "a mass was added", "look for a lamp"),
        ("section_loss", "section was lost over a stretch", "check the rod for corrosion"),
        ("bending_stiffness", "bending stiffness fell", "check for broken wires"),
        ("timebase", "the logger's clock is wrong", "check the logger's clock"),
        ("sensor_mass", "sensors are heavier or elsewhere", "check which sensors"),
        ("unexplained", "no known cause explains it", "check hanger, sensors, axes"),
    ],
)
def test_another_cause_says_what_to_check_before_the_next_test(
    cause: str, state: str, action: str
) -> None:
    moved = Moved(cause, 0.95, -0.0082, 0.0012)
    message = only(day(2, change(called=True, moved=(moved,)))).message
    assert message.startswith(
        f"Hanger 3: {state} (frequencies fell by 0.82 ± 0.20 % on average). Within a week, {action}"
    )
    assert ", then test again." in message


@pytest.mark.parametrize(
    ("said", "action"),
    [
        (
            (change(called=True), 0.99),
            "Check the hanger and its sensors today and decide on traffic",
        ),
        ((change(called=True), 0.1), "Check the hanger and its sensors within a week; if the loss"),
        ((change(called=True, moved=()), 0.1), "Check the hanger and its sensors within a week."),
    ],
)
def test_of_a_hanger_whose_sensors_stay_nobody_asks_for_a_hammer_test(
    said: tuple[Change, float], action: str
) -> None:
    (alert,) = replay([day(2, *said)], MonitoredHanger.of(HANGER_3))[1]
    assert f". {action}" in alert.message
    for in_a_row in (1, 3):
        odd = message_of_odd(day(2), MonitoredHanger.of(HANGER_3), in_a_row)
        assert Lead.of(odd).action == "Check the hanger and its sensors within a week."
        assert "hammer" not in odd
    assert asdict(MonitoredHanger.of(HANGER_3)) == asdict(HANGER_3)  # results stay as they are


def test_beyond_the_threshold_after_a_call_speaks_of_the_called_change() -> None:
    """After a call the watch looks for a further change: what it makes of that is no cause."""
    further = change(began=9, probability=0.99, sudden=0.5, moved=(ARCH,))
    call, beyond = replay([day(2, change(called=True, began=2)), day(9, further, 0.97)], HANGER_3)[
        1
    ]
    assert call.change is not None
    assert beyond.change == replace(call.change, probability=0.99)
    assert beyond.message.endswith(
        "The probability that tension is beyond its threshold of 5 % is 0.97. "
        "The probability of any change, which allows for disturbed visits, is 0.99."
    )
    assert "between 2026-04-30 and 2026-05-03" in beyond.message
    assert "k3" not in beyond.message
    assert "false alarms" not in beyond.message


def test_a_message_gives_the_probabilities_of_its_document() -> None:
    """Also where the shift, all tests taken at face value, is surer than the detector."""
    alert = only(day(2, change(called=True, began=2, probability=0.94), 0.999))
    assert alert.change is not None
    assert (alert.change.probability, alert.drifts[0].probability) == (0.94, 0.999)
    assert (
        "The probability that tension is beyond its threshold of 5 % is above 0.99. "
        "The probability of any change, which allows for disturbed visits, is 0.94."
    ) in alert.message


@pytest.mark.parametrize(
    ("quantity", "mean", "sd", "words"),
    [
        ("tension", -0.01, 0.02, "moved by -1.0 ± 3.3 %"),
        ("tension", 0.02, 0.0005, "rose by 2.00 ± 0.08 %"),
        ("tension", -0.25, 0.08, "fell by 25 ± 13 %"),
        ("timebase", 0.002, 0.0001, "rose by 0.20 ± 0.02 %"),
        ("log10_k1", 0.5, 0.1, "rose to about 3.2 times its former value"),
        ("log10_k1", -0.15, 0.02, "fell to about 71 % of its former value"),
        ("log10_k1", -0.48, 0.1, "fell to about 33 % of its former value"),
        ("log10_k1", -3.0, 0.1, "fell to less than a twentieth"),
        ("log10_k1", 4.0, 2.0, "rose to more than 1000 times its former value"),
    ],
)  # fmt: skip
def test_shifts_read_as_people_say_them(quantity: str, mean: float, sd: float, words: str) -> None:
    assert shift_words(quantity, mean, sd) == words


def test_of_a_called_change_all_tell_the_probability_that_its_alert_tells() -> None:
    faint = (a_drift(probability=0.6),)
    called, quiet = (
        replace(a_watched_test(evidence_years=years), drifts=faint) for years in (350.0, 1.0)
    )
    assert [each.published_drifts[0].probability for each in (called, quiet)] == [0.7, 0.6]
