"""The state of a hanger: in a word, in the two sentences that everybody reads first, and why.

`hanger_message` alone decides state, action, urgency and reasons. Home page, the hanger's page,
report, `shm status` and their documents show its answer; an alert and what its hooks get lead with
the same words of what was found (`lead_of`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import TYPE_CHECKING

from shm.report import formatting
from shm.report.formatting import NORMAL_90, Interval
from shm.values import TENSION, Alert, Averaged, Change, Drift, Hanger, WatchedTest
from shm.values.messages import NEXT_TEST, TODAY, URGENCIES, WEEK, Lead, Urgency
from shm.values.posterior import DIAGNOSE
from shm.values.rounding import NINETY_PERCENT, force_unit, listed, rounded_percent
from shm.watch.words.alert_text import lead_of, look_again, quantity_words, size_words

if TYPE_CHECKING:
    from shm.report.hanger_summary import HangerSummary
    from shm.watch.control_chart import ControlChart

WATCH_PROBABILITY = 0.5  # likelier than not
# Judgement: dead load and erection leave the hangers of sound bridges some 10 % off nominal. With
# the whole interval beyond 15 % either the description or the hanger is in doubt, until the owner
# gives limits.
OFF_NOMINAL = 0.15

_DOUBTS = frozenset({"check the modes", "check the baseline", "limit", "silent"})
_BEYOND = "beyond threshold"
_CHANGES = frozenset({_BEYOND, "sudden change", "slow drift"})


UNDETERMINED = "These modes do not determine the tension"


_LEADS: dict[str, tuple[str, str]] = {
    "no hanger tested": ("No hanger has been tested yet.", f"Test all {NEXT_TEST}."),
    "quiet": ("{found}", "No action is needed before the next planned test."),
    "untested": ("{name}: no test yet.", f"Test it {NEXT_TEST}."),
    "waiting": (
        "{name}: {tests}, no result yet.",
        "No action is needed: the daemon is at work, or waits for more tests for a baseline.",
    ),
    "in doubt": (
        "{name}: {what} is in doubt.",
        f"Check its description and the numbers of its modes {NEXT_TEST}.",
    ),
    "unusable": (
        "{name}: do not use {what}.",
        f"Check its description and the numbers of its modes {WEEK}.",
    ),
    "not converged": (
        "{name}: do not use {what}.",
        "Raise `samples` in bridge.toml and run "
        f"`shm ingest --again {{test}} --from updated` {WEEK}.",
    ),
    "likely beyond": (
        "{name}: {what}, more likely than not beyond its threshold.",
        f"{{again}} {WEEK}.",
    ),
    "first": (
        "{name}: tension {tension}, and no test after its baseline.",
        "No action is needed before the next planned test: choose a warmer or colder day for it, "
        "so that the baseline covers temperature.",
    ),
    "first of sensors": (
        "{name}: tension {tension}, and no test after its baseline.",
        "No action is needed: the next days will be warmer or colder.",
    ),
    "undetermined": (
        "{name}: these modes do not determine the tension.",
        f"Identify more modes {NEXT_TEST}, or state length and ends more exactly.",
    ),
    "not comparable": (
        "{name}: its latest test cannot be compared with the baseline.",
        f"{{again}} {WEEK}: it lacks modes of the baseline.",
    ),
    "rough": (
        "{name}: no change detected, but its tests are too few or too imprecise to show one "
        "(tension {shift}).",
        f"Identify more modes {NEXT_TEST}, or test more often.",
    ),
    "steady": (
        "{name}: no change detected since the baseline (tension {shift}).",
        "No action is needed before the next planned test.",
    ),
    "slack": (
        "{name}: tension {tension}{by} is {doubt}below its lower limit.",
        f"{{again}} {TODAY}, and compare it with its design.",
    ),
    "overloaded": (
        "{name}: tension {tension}{by} is {doubt}above its upper limit.",
        f"{{again}} {WEEK}, and compare it with its design.",
    ),
    "off nominal": (
        "{name}: tension is {size} {side} nominal.",
        f"Compare it with the design {NEXT_TEST}, or give limits in bridge.toml.",
    ),
}
"""State and action by what is known of a hanger; what was found to change is in `lead_of`."""


def _lead(key: str, hanger: Hanger | None = None, **values: str) -> Lead:
    """Return state and action with the hanger and `values` filled in."""
    if hanger is not None:
        values |= {"name": f"Hanger {hanger.id}", "again": look_again(hanger)}
    state, action = _LEADS[key]
    return Lead(state.format(**values), action.format(**values))


class Status(Enum):
    """The state of a hanger in a word."""

    ALERT = "Alert"
    WATCH = "Watch"
    CHECK = "Check"
    UNCLEAR = "Cannot judge"
    STEADY = "No change"
    FIRST = "Baseline only"


QUIET = (Status.STEADY, Status.FIRST)
"""States in which nothing was found."""


@dataclass(frozen=True)
class HangerMessage:
    """The state in a word, None where nothing is known; its lead; what people did about it.

    `reasons` are all doubts that the lead has not said, the worst first.
    """

    status: Status | None
    lead: Lead
    notes: tuple[str, ...] = ()
    reasons: tuple[str, ...] = ()

    @property
    def urgency(self) -> Urgency:
        return self.lead.urgency

    @property
    def needs_action(self) -> bool:
        """Return True if the action is due by some time, or the state is not a quiet one."""
        return self.is_known and (self.urgency != "none" or self.status not in QUIET)

    @property
    def is_known(self) -> bool:
        return self.status is not None or self.urgency == "today"

    @property
    def words(self) -> str:
        return " ".join((self.lead.words, *self.notes))

    def beyond_lead(self, warnings: Sequence[str]) -> tuple[str, ...]:
        """Return what `warnings` say that the lead does not."""
        rest = (each.removeprefix(self.lead.words).strip() for each in warnings)
        return tuple(each for each in rest if each)

    @property
    def document(self) -> dict[str, object]:
        """As every JSON document gives it."""
        return {**_document(self), "reason": " ".join(self.reasons)}


@dataclass(frozen=True)
class BridgeMessage:
    """State and action of a bridge: of its most urgent hanger, then which others need action."""

    status: Status | None
    lead: Lead
    others: str = ""
    notes: tuple[str, ...] = ()

    @property
    def urgency(self) -> Urgency:
        return self.lead.urgency

    @property
    def words(self) -> str:
        return " ".join(part for part in (self.lead.words, *self.notes, self.others) if part)

    @property
    def document(self) -> dict[str, object]:
        """As every JSON document gives it."""
        return _document(self)


def _document(message: HangerMessage | BridgeMessage) -> dict[str, object]:
    return {
        "status": message.status.name.lower() if message.status else None,
        "state": message.lead.state,
        "action": message.lead.action,
        "urgency": message.urgency,
        "notes": list(message.notes),
    }


def bridge_message(messages: Mapping[int, HangerMessage]) -> BridgeMessage:
    """Return that of a bridge from those of its hangers, by their numbers."""
    order = list(Status)
    known = {id_: each for id_, each in messages.items() if each.is_known}
    found = {each.status for each in known.values()}
    worst = next((status for status in Status if status in found), None)
    needing = {id_: each for id_, each in known.items() if each.needs_action}

    def rank(id_: int) -> tuple[int, int, bool]:
        one = needing[id_]
        place = order.index(one.status) if one.status else len(order)
        return -URGENCIES.index(one.urgency), place, bool(one.notes)  # what nobody noted first

    if not known:
        return BridgeMessage(None, _lead("no hanger tested"))
    untested = [str(id_) for id_ in messages if id_ not in known]
    more = f"Not tested yet: {listed(untested)}." if untested else ""
    if needing:
        first, *others = sorted(needing, key=rank)
        more = f"{_how_soon(needing, others)} {more}".strip()
        return BridgeMessage(worst, needing[first].lead, more, needing[first].notes)
    return BridgeMessage(worst, _lead("quiet", found=_found(known.values())), more)


def _found(known: Iterable[HangerMessage]) -> str:
    """Return on how many hangers no change was detected, and on how many none can be judged."""
    statuses = [each.status for each in known]
    n_first = statuses.count(Status.FIRST)
    compared = formatting.counted(len(statuses) - n_first, "hanger")
    first = f"{formatting.counted(n_first, 'hanger')} {'has' if n_first == 1 else 'have'}"
    sentences = (
        f"No change detected on {compared}." if n_first < len(statuses) else "",
        f"{first} a baseline only: no change can be judged yet." if n_first else "",
    )
    return " ".join(sentence for sentence in sentences if sentence)


_SOON = {"none": "when convenient", "next_test": NEXT_TEST, "week": WEEK, "today": TODAY}


def _how_soon(needing: Mapping[int, HangerMessage], others: Iterable[int]) -> str:
    """Return the others by urgency, the most urgent first; empty where there are none."""
    of: dict[Urgency, list[int]] = {}
    for id_ in others:
        of.setdefault(needing[id_].urgency, []).append(id_)
    order = [urgency for urgency in reversed(URGENCIES) if urgency in of]
    statement = [f"{_SOON[each]}: {listed(list(map(str, sorted(of[each]))))}" for each in order]
    rest = (f" {each[0].upper()}{each[1:]}." for each in statement[1:])
    return f"Other hangers that need action {statement[0]}.{''.join(rest)}" if statement else ""


def hanger_message(known: HangerSummary) -> HangerMessage:
    """Decide state, action, urgency and reasons of a hanger, for every place that shows them."""
    status, lead = _decide(known)
    statement = HangerMessage(status, lead, known.notes if status else ())
    caveats = known.tension.caveats if known.tension else ()
    if (doubted := known.doubted) is not None and doubted is not known.tension:
        caveats += tuple(f"By the latest test: {each}" for each in doubted.faults)
    if known.diagnosed:
        caveats = (*(each.replace(DIAGNOSE, "") for each in caveats), known.diagnosed)
    return replace(statement, reasons=(*statement.beyond_lead(known.warnings), *caveats))


def _decide(known: HangerSummary) -> tuple[Status | None, Lead]:
    if known.latest is None and not known.standing:
        if not known.tests:
            return None, _lead("untested", known.hanger)
        return None, _lead("waiting", known.hanger, tests=formatting.counted(known.tests, "test"))
    if known.control is not None and (latest := known.control.latest) is not None:
        return Status.CHECK if latest.is_out else Status.STEADY, control_lead(known.control)
    faults = known.doubted.faults if known.doubted else ()
    status = status_of(
        known.drifts,
        known.hanger,
        is_first=known.is_first,
        is_called=bool(known.called),
        warnings=(*known.warnings, *faults),
        standing=known.standing,
    )
    if status in (Status.ALERT, Status.WATCH):
        return status, _of_change(known)
    if status is Status.CHECK:
        off = _off_limits(known)  # as it is now, where an alert says how it was
        doubts = [
            *(Lead.of(each) for each in known.warnings),
            *([_in_doubt(known)] if faults else []),
            *([off] if off else []),
            *(
                Lead.of(each.message)
                for each in reversed(known.standing)
                if not (off and "limit" in each.kinds)
            ),
        ]
        silent = all(each.kinds == ("silent",) for each in known.standing)
        if known.unwatched and silent and not (known.warnings or faults or off):
            status = Status.UNCLEAR
        return status, _first(doubts)
    return _quiet(known, status)


CONTROL_REMEDY = f"Check clock and sampling rate of the logger, and repeat the control test {WEEK}."


def control_lead(chart: ControlChart) -> Lead:
    """Return state and action of a control hanger."""
    name, latest = f"Control hanger {chart.hanger.id}", chart.latest
    if latest is None:
        return Lead(f"{name}: no test yet.", f"Test it {NEXT_TEST}.")
    size = rounded_percent(latest.deviation, NORMAL_90 * latest.sd, "+")
    if latest.is_out:
        return Lead(f"{name}: {size} from its known tension, out of its limits.", CONTROL_REMEDY)
    return Lead(f"{name}: {size} from its known tension, within its limits.", "No action needed.")


def _in_doubt(known: HangerSummary) -> Lead:
    """Return what to do about a tension whose caveats say that something is wrong."""
    what = "its tension" if known.doubted is known.tension else "the tension by its latest test"
    if known.doubted is None or known.doubted.is_usable:
        return _lead("in doubt", known.hanger, what=what)
    if known.doubted.has_converged:
        return _lead("unusable", known.hanger, what=what)
    test = known.latest.name if known.latest else ""
    return _lead("not converged", known.hanger, what=what, test=test)


def still_detected(
    detected: Iterable[Change], latest: WatchedTest | None, hanger: Hanger
) -> tuple[Change, ...]:
    """Return the changes that were detected, unless the latest test shows that they are gone.

    As the watch does: below half the level at which its owner is alerted.
    """
    over = latest and latest.change.probability < hanger.thresholds.end_probability
    return () if over else tuple(detected)


def findings(alerts: Iterable[Alert]) -> tuple[Alert, ...]:
    """Return alerts without trials of the hooks, which do not concern the hanger."""
    return tuple(each for each in alerts if each.kinds != ("test",))


def status_of(
    drifts: Sequence[Drift],
    hanger: Hanger,
    *,
    is_first: bool,
    is_called: bool,
    warnings: Sequence[str] = (),
    standing: Sequence[Alert] = (),
) -> Status:
    """Return the state that the drifts of the latest test give, and whether a change was detected.

    With open `warnings` no hanger is quiet: what it is compared with may be wrong. Nor is one of
    which an alert is `standing`: two tests that agree show a shift before the watch is sure.
    """
    highest = max((d.probability for d in drifts if d.probability >= 0), default=math.nan)
    kinds = [each.kinds for each in standing]
    if highest >= hanger.thresholds.alert_probability or any(_BEYOND in k for k in kinds):
        return Status.ALERT
    if (
        highest >= WATCH_PROBABILITY
        or is_called
        or any(not k or not _DOUBTS.issuperset(k) for k in kinds)
    ):
        return Status.WATCH
    if warnings or standing:
        return Status.CHECK
    return Status.FIRST if is_first else Status.STEADY


# ---------------------------------------------------------------- what was found


def _of_change(known: HangerSummary) -> Lead:
    """Return what was detected to have changed; else what an alert of another kind asks for."""
    hanger, drifts = known.hanger, known.drifts
    beyond, change = shifts_beyond(known), _change(known)
    others = [each for each in known.standing if not _CHANGES & set(each.kinds)]
    if beyond or change:
        before = change and [each for each in known.called if each.began_by < change.began_by]
        is_further = bool(before)
        return lead_of(hanger, change, beyond, drifts, is_further=is_further)
    if any(_CHANGES & set(each.kinds) for each in known.standing):
        others = list(known.standing)  # what its row said of the change is lost
    if others:
        return _first([Lead.of(each.message) for each in reversed(others)])
    first = max(drifts, key=lambda each: each.probability)
    what = f"{quantity_words(first.quantity)} {size_words(first)}"
    return _lead("likely beyond", hanger, what=what)


def shifts_beyond(known: HangerSummary) -> list[Drift]:
    """Return the shifts beyond their threshold, as the latest test has them.

    What an alert said stays as sure as it was while it stands; where two tests that agree said it,
    the watch may not have seen it, and the alert's own number stays.
    """
    level = known.hanger.thresholds.alert_probability
    found = {_way(each): each for each in known.drifts if each.probability >= level}
    now = {_way(each): each for each in known.drifts}
    for alert in known.standing:
        for wording in alert.drifts if _BEYOND in alert.kinds else ():
            key = _way(wording)
            newest = now.get(key, wording)
            is_of_latest = known.latest is not None and alert.test == known.latest.name
            seen = (
                newest if not is_of_latest and newest.may_be_beyond(wording.shift_mean) else wording
            )
            found[key] = replace(seen, probability=max(seen.probability, wording.probability))
    return list(found.values())


def _way(drift: Drift) -> tuple[str, bool]:
    return drift.quantity, drift.shift_mean < 0


def _change(known: HangerSummary) -> Change | None:
    """Return that of the newest alert that stands; else the last that was detected."""
    wording = [each.change for each in known.standing if each.change and _CHANGES & set(each.kinds)]
    return wording[-1] if wording else known.called[-1] if known.called else None


def _first(leads: Sequence[Lead]) -> Lead:
    """Return the first of the most urgent."""
    return max(leads, key=lambda each: URGENCIES.index(each.urgency))


# ---------------------------------------------------------------- nothing was found


def _quiet(known: HangerSummary, status: Status) -> tuple[Status, Lead]:
    """Return the lead where nothing was detected: could it have been, and what the tension is."""
    hanger, off = known.hanger, _off_limits(known)
    if known.unwatched is not None and (off is None or off.urgency == "next_test"):
        return Status.UNCLEAR, known.unwatched
    if off:
        return Status.CHECK, off
    if status is Status.FIRST:
        if not known.is_determined:
            return status, _lead("undetermined", hanger)
        key = "first of sensors" if hanger.has_sensors else "first"
        return status, _lead(key, hanger, tension=_tension(known.tension))
    drift = next((each for each in known.drifts if each.quantity == TENSION), None)
    if drift is None or not math.isfinite(drift.shift_mean + drift.shift_sd):
        return Status.UNCLEAR, _lead("not comparable", hanger)
    half = NINETY_PERCENT * drift.shift_sd
    shift = rounded_percent(drift.shift_mean, half, "+")
    if half > drift.threshold:
        return Status.UNCLEAR, _lead("rough", hanger, shift=shift)
    return status, _lead("steady", hanger, shift=shift)


def off_limits(hanger: Hanger, tension: Averaged, by: str = "") -> Lead | None:
    """Return that the tension is beyond its owner's limits, `by` which test; None where not."""
    for probability, key in (
        (tension.probability_slack, "slack"),
        (tension.probability_above_limit, "overloaded"),
    ):
        if probability > WATCH_PROBABILITY:
            doubt = "" if probability >= hanger.thresholds.alert_probability else "probably "
            return _lead(key, hanger, tension=_tension(tension), by=by, doubt=doubt)
    return None


def _off_limits(known: HangerSummary) -> Lead | None:
    """Return that the tension is beyond its limits; without these, far off the nominal one."""
    hanger, tension = known.hanger, known.tension
    if tension is None or not tension.is_usable:
        return None
    if beyond := off_limits(hanger, tension):
        return beyond
    limits = hanger.limits
    nominal_n, retained = hanger.nominal_tension_n, tension.tension_n
    if not nominal_n > 0:
        return None
    low, high = retained.q05 / nominal_n - 1, retained.q95 / nominal_n - 1
    limit_n = limits.tension_max_n if low > 0 else limits.tension_min_n
    if (low <= OFF_NOMINAL and high >= -OFF_NOMINAL) or math.isfinite(limit_n):
        return None
    off = retained.mean / nominal_n - 1
    size = rounded_percent(abs(off), (high - low) / 2)
    return _lead("off nominal", hanger, size=size, side="above" if off > 0 else "below")


def _tension(tension: Averaged | None) -> str:
    """Return `654 ± 16 kN`, rounded by its interval."""
    if tension is None:
        return "not known"
    interval = Interval.of_averaged(tension)
    return formatting.with_half(interval, force_unit(interval.mean))
