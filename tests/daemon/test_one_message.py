"""Every state of a hanger, on every surface: the same state, number, action and urgency.

The surfaces are home page, hanger page, report, alert, what a hook gets, and `shm status`; each as
a person reads it and as a document. What they say keeps to the rules of the product's language.
"""

from __future__ import annotations

import html
import json
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import datetime, timedelta

import httpx
import numpy as np
import pytest
from click.testing import CliRunner

from shm.documents import alert_document
from shm.pipeline import utc_now
from shm.pipeline.bridge_reporting import bridge_report
from shm.pipeline.reporting import hanger_report
from shm.report.as_text import as_text
from shm.report.bridge_report import bridge_json, bridge_paper
from shm.report.bridge_report import summary as bridge_summary
from shm.report.hanger_report import hanger_json, hanger_paper
from shm.report.hanger_sentences import summary
from shm.report.hanger_status import Status
from shm.store import Store, StoredTest, Workspace
from shm.values import Alert, Change, Drift, Moved, RepeatedMistake, WatchedTest
from shm.values.messages import Lead, Urgency
from shm.watch.watching import replay
from shm.watch.words.alert_text import message_of
from shm_cli.main import cli
from shm_daemon.web.commands import set_reader, without_commands
from tests.helpers.entering import LINEAGE, identified, selected
from tests.helpers.hangers import HANGER_3
from tests.helpers.nouns import NOW, a_change, a_posterior
from tests.helpers.web_servers import Served, served
from tests.helpers.workspaces import make_workspace
from tests.watch.test_alert_language import AVOIDED, MOST_NUMBERS, MOST_WORDS, NUMBER

_QUIET = a_change(
    evidence_years=0.2, probability=0.02, moved=(a_change().moved[0],), outlier_probability=0.01
)


@dataclass
class Hangers:
    """Fills a store with one hanger a state."""

    workspace: Workspace
    store: Store
    now: datetime

    def test(self, hanger: int, days: float, tension: float = 1.0) -> StoredTest:
        """One test that has been through updating, so many days after the baseline."""
        count = len(self.store.tests.list_all(hanger))
        named = {"hanger": hanger, "name": f"h{hanger}-{count}", "days": days}
        stored = identified(self.store, 100 * hanger + count, **named)  # type: ignore[arg-type]
        plain = replace(a_posterior(tests=(stored.test.id,)), hanger=hanger)
        samples = plain.samples * np.array([tension, 1, 1])
        posterior = replace(plain, samples=samples, effective_sample_size=400.0)
        if count:
            self.store.posteriors.save(stored, posterior, LINEAGE, NOW)
        else:
            selected(self.store, [stored], posterior)
        return stored

    def watched(self, hanger: int, drifts: Sequence[Drift], change: Change, **more: object) -> None:
        """Add a test after the others, as the watch found it, with the alert it calls for."""
        days = 30 * len(self.store.tests.list_all(hanger))
        test, baseline = self.test(hanger, days), self.store.watch.baseline(hanger)
        assert baseline is not None
        name, time = test.test.id, test.time
        own = tuple(replace(d, hanger=hanger, test=name, time=time) for d in drifts)
        found = WatchedTest(name, time, 11.5, own, change, None, **more)  # type: ignore[arg-type]
        before = [each.watched for each in self.store.watch.list_all(hanger, baseline.id)]
        every = replay([*before, found], replace(HANGER_3, id=hanger))[1]
        alert = next((each for each in every if each.test == found.test), None)
        self.store.watch.save(test, baseline, found, alert, ["mail"], time)

    def raised(self, hanger: int) -> int:
        return self.store.alerts.list_all(hanger)[-1].id


def tension(shift: float = 0.002, sd: float = 0.007, probability: float = 0.01) -> Drift:
    return Drift(3, "", NOW, "tension", 711e3, 711e3 * (1 + shift), shift, sd, 0.05, probability)


def moved(**values: object) -> tuple[Moved, ...]:
    return (replace(a_change().moved[0], **values),)


def watched(*drifts: Drift, change: Change = _QUIET, times: int = 1, **more: object) -> Make:
    """Make a first test and, so many times, a later one as the watch found it."""

    def make(of: Hangers, hanger: int) -> None:
        if not of.store.tests.list_all(hanger):
            of.test(hanger, 0)
        for _ in range(times):
            of.watched(hanger, drifts, change, **more)

    return make


def after(*steps: Make) -> Make:
    """Make one thing after the other."""

    def make(of: Hangers, hanger: int) -> None:
        for step in steps:
            step(of, hanger)

    return make


def _silence(of: Hangers, hanger: int) -> None:
    period = (of.now - timedelta(hours=1), of.now + timedelta(days=3))
    of.store.silences.make(hanger, period, "Ann", "works", of.now)


def _held(of: Hangers, hanger: int) -> None:
    of.test(hanger, 0)
    _raise(of, hanger, "held", f"Hanger {hanger}: test t9 (recording 12) is held: its time cannot "
           "be 2001-01-01 00:00. Within a week, confirm it with its true time, or discard it: "
           "`shm ingest --confirm 12 --time TIME` or `shm ingest --discard 12`.")  # fmt: skip


def _stream_alone(of: Hangers, hanger: int) -> None:
    """Permanent sensors have raised an alert; no hammer test was ever made."""
    drifts, change = (replace(tension(-0.085, 0.0055, 0.999), hanger=hanger),), a_change()
    test = WatchedTest("h 12:00", NOW, 11.5, drifts, change)
    said = message_of(test, replace(HANGER_3, id=hanger), change, drifts, is_call=True)
    _raise(of, hanger, "beyond threshold", said, drifts, change)


def _raise(
    of: Hangers,
    hanger: int,
    kind: str,
    message: str,
    drifts: tuple[Drift, ...] = (),
    change: Change | None = None,
) -> None:
    from shm.store.alerts import raise_alert

    alert = Alert(
        f"hanger-{hanger}:{kind}", hanger, "h 12:00", NOW, message, drifts, (kind,), change
    )  # type: ignore[arg-type]
    with of.store.alerts.writing() as connection:
        raise_alert(connection, None, None, alert, ["mail"], NOW)


Make = Callable[[Hangers, int], None]
a_loss = watched(tension(-0.085, 0.0055, 0.999), change=a_change())
_below = moved(shift_mean=-0.03, probability=0.97, alike=())
_gain = a_change(moved=moved(shift_mean=0.08))
_mistake = RepeatedMistake("transverse", 3, NOW, 3)
_deck_end = Drift(3, "", NOW, "log10_k1", 7.0, 6.2, -0.8, 0.1, 0.5, 0.99)
# A loss stands; then an end loosens, too.
_loosened = replace(_QUIET, probability=0.99)
_two_quantities = after(a_loss, watched(tension(-0.09, 0.005, 0.999), _deck_end, change=_loosened))
_acknowledged = after(
    a_loss, lambda of, n: of.store.alerts.acknowledge(of.raised(n), "Ann", "on its way", NOW)
)
_ended = after(
    a_loss,
    lambda of, n: of.store.alerts.resolve(of.raised(n), "Ann", "retensioned", NOW),
    watched(tension()),
)
_odd = replace(_QUIET, outlier_probability=0.97)
_not_known = tension(*[float("nan")] * 3)
STATES: dict[str, tuple[Make, Status | None, Urgency]] = {
    "no test yet": (lambda of, n: None, None, "next_test"),
    "first test": (lambda of, n: of.test(n, 0), Status.FIRST, "none"),
    "steady": (watched(tension()), Status.STEADY, "none"),
    "too rough to judge": (watched(tension(0.01, 0.04, 0.1)), Status.UNCLEAR, "next_test"),
    "shift not known": (watched(_not_known), Status.UNCLEAR, "week"),
    "not compared": (lambda of, n: (of.test(n, 0), of.test(n, 30)), Status.UNCLEAR, "week"),
    "likely beyond": (watched(tension(-0.055, 0.012, 0.7)), Status.WATCH, "week"),
    "detected below its threshold": (
        watched(tension(-0.03, 0.01, 0.05), change=a_change(moved=_below)), Status.WATCH, "week",
    ),
    "slow": (
        watched(tension(-0.03, 0.01, 0.05), change=a_change(moved=_below, sudden=0.05)),
        Status.WATCH, "next_test",
    ),
    "loss": (a_loss, Status.ALERT, "today"),
    "gain": (watched(tension(0.08, 0.006, 0.99), change=_gain), Status.ALERT, "week"),
    "an end after a loss": (_two_quantities, Status.ALERT, "today"),
    "acknowledged": (_acknowledged, Status.ALERT, "today"),
    "silenced": (after(a_loss, _silence), Status.ALERT, "today"),
    "odd test": (watched(tension(), change=_odd), Status.WATCH, "week"),
    "three odd tests": (watched(tension(), change=_odd, times=3), Status.WATCH, "week"),
    "misnumbered mode": (watched(tension(), mistaken=(_mistake,)), Status.CHECK, "next_test"),
    "baseline alone": (
        watched(tension(), change=replace(_QUIET, against_baseline=4)), Status.CHECK, "week",
    ),
    "off nominal": (lambda of, n: of.test(n, 0, 1.2), Status.CHECK, "next_test"),
    "stale": (lambda of, n: of.test(n, -900), Status.UNCLEAR, "week"),
    "held": (_held, Status.WATCH, "week"),
    "stream alone": (_stream_alone, Status.ALERT, "today"),
    "ended": (_ended, Status.STEADY, "none"),
}  # fmt: skip
NUMBER_OF = {name: number for number, name in enumerate(STATES, start=1)}
every_state = pytest.mark.parametrize("name", STATES)


@pytest.fixture(scope="module")
def bridge(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    folder = tmp_path_factory.mktemp("states") / "bridge"
    numbers = tuple(NUMBER_OF.values())
    workspace = make_workspace(folder, hangers=numbers, hooks={"mail": ["true"]})
    with workspace.store() as store:
        hangers = Hangers(workspace, store, utc_now())
        for name, (make, *_) in STATES.items():
            make(hangers, NUMBER_OF[name])
    return workspace


@pytest.fixture(scope="module")
def store(bridge: Workspace) -> Iterator[Store]:
    with bridge.store() as store:
        yield store


@pytest.fixture(scope="module")
def client(bridge: Workspace) -> Iterator[httpx.Client]:
    with served(bridge) as site, site.client() as client:
        assert isinstance(site, Served)
        yield client


@pytest.fixture(scope="module")
def home(client: httpx.Client) -> tuple[str, dict[int, dict[str, object]]]:
    rows = client.get("/api/bridge").json()["hangers"]
    return _read(client.get("/").text), {row["hanger"]: row for row in rows}


@pytest.fixture(scope="module")
def status(bridge: Workspace) -> tuple[str, dict[int, dict[str, object]]]:
    def run(*arguments: str) -> str:
        told = CliRunner().invoke(cli, ["--workspace", str(bridge.folder), "status", *arguments])
        assert told.exit_code == 0, told.output
        return told.stdout

    rows = json.loads(run("--json"))["hangers"]
    return _flat(run()), {row["hanger"]: row for row in rows}


def _read(page: str) -> str:
    """Return a page's words."""
    return _flat(html.unescape(re.sub(r"<(?:.|\n)*?>", "", page)))


def _on_page(text: str) -> str:
    """Return a message as a page has it: a page is named where others name a shell command."""
    set_reader(None, is_engineer=False)  # as a page does for who has not signed in
    return _flat(without_commands(text))


def _flat(text: str) -> str:
    return " ".join(text.replace("`", "").split())


def _lead(document: dict[str, object]) -> tuple[object, ...]:
    return tuple(document[key] for key in ("state", "action", "urgency"))


@every_state
def test_all_surfaces_say_the_same(
    name: str,
    bridge: Workspace,
    store: Store,
    client: httpx.Client,
    home: tuple[str, dict[int, dict[str, object]]],
    status: tuple[str, dict[int, dict[str, object]]],
) -> None:
    number, (_, expected, urgency) = NUMBER_OF[name], STATES[name]
    first = home[1][number]
    words = _flat(f"{first['state']} {first['action']}")
    on_page = _on_page(f"{first['state']} {first['action']}")
    assert (first["status"], first["urgency"]) == (expected and expected.name.lower(), urgency)
    for document in (status[1][number], client.get(f"/api/hangers/{number}").json()):
        assert _lead(document) == _lead(first)
        assert (document["status"], document["notes"]) == (first["status"], first["notes"])
    if expected not in (None, Status.STEADY, Status.FIRST):
        assert on_page in home[0]
    if store.tests.list_all(number) and urgency != "none":
        assert words in status[0]
    assert on_page in _read(client.get(f"/hangers/{number}").text)
    if store.tests.list_all(number):
        report = hanger_report(bridge, store, number, utc_now())
        assert _lead(hanger_json(report)["message"]) == _lead(first)
        assert words in _flat(as_text(hanger_paper(report)))


@every_state
def test_a_standing_alert_and_its_hooks_say_what_the_pages_say(
    name: str, store: Store, home: tuple[str, dict[int, dict[str, object]]]
) -> None:
    standing = store.alerts.list_all(NUMBER_OF[name], standing=True)
    for stored in standing[-1:]:
        lead = Lead.of(stored.alert.message)
        document = alert_document(stored.alert)
        assert _lead(document) == (lead.state, lead.action, lead.urgency)
        assert _lead(document) == _lead(home[1][NUMBER_OF[name]])


def test_the_bridge_leads_with_its_most_urgent_hanger(
    bridge: Workspace, store: Store, home: tuple[str, dict[int, dict[str, object]]]
) -> None:
    report = bridge_report(bridge, store, utc_now())
    told = bridge_json(report)["message"]
    assert _lead(told) == _lead(home[1][NUMBER_OF["loss"]])
    assert report.message.urgency == "today"
    assert _on_page(report.message.words) in home[0]
    named = {NUMBER_OF["loss"], *map(int, re.findall(r"\d+", report.message.others))}
    assert named == {id_ for id_, each in home[1].items() if each["urgency"] != "none"}
    assert _flat(as_text(bridge_paper(report))).count(_flat(report.message.words)) == 1


def test_who_acknowledged_and_who_silenced_is_said_beside_it(
    home: tuple[str, dict[int, dict[str, object]]],
) -> None:
    for name, words in (("acknowledged", "acknowledged by Ann"), ("silenced", "silenced until")):
        (note,) = home[1][NUMBER_OF[name]]["notes"]  # type: ignore[misc]
        assert words in note
    assert home[1][NUMBER_OF["acknowledged"]]["state"] == home[1][NUMBER_OF["loss"]][
        "state"
    ].replace(f"Hanger {NUMBER_OF['loss']}", f"Hanger {NUMBER_OF['acknowledged']}")  # type: ignore[attr-defined]


# ---------------------------------------------------------------- the rules of the language


def sentences(text: str) -> list[str]:
    return re.split(r"(?<=[.?]) (?=[A-Z±`])", text)


_NAMES = re.compile(
    r"`[^`]*`"  # commands
    r"|\d{4}-\d{2}-\d{2}( \d{2}:\d{2})?|\bh\d+-\d+"  # dates and tests
    r"|(angers?( that need action [a-z ]+)?|Within a week|At the next planned test):? \d[\d, and]*"
    r"|yet: \d[\d, and]*"
    r"|\(recording \d+\)|Alert \d+|beam\d|(transverse|longitudinal) \d+|90 % (?=interval)"
)


def numbers_of(sentence: str) -> list[str]:
    """Those of a sentence but for names, dates and commands."""
    return NUMBER.findall(_NAMES.sub("", sentence))


def rendered(bridge: Workspace, store: Store) -> Iterator[str]:
    """All that a person reads first: of each hanger, of the bridge, of each alert."""
    report = bridge_report(bridge, store, utc_now())
    yield from (line.message.words for line in report.hangers)
    yield bridge_summary(report)
    for number in NUMBER_OF.values():
        if store.tests.list_all(number):
            yield summary(hanger_report(bridge, store, number, utc_now()))
    yield from (each.alert.message for each in store.alerts.list_all())


@pytest.fixture(scope="module")
def texts(bridge: Workspace, store: Store) -> tuple[str, ...]:
    return tuple(rendered(bridge, store))


def test_the_first_sentence_has_few_words(texts: tuple[str, ...]) -> None:
    assert [t for t in texts if len(sentences(t)[0].split()) > MOST_WORDS] == []


def test_no_sentence_has_more_than_two_numbers(texts: tuple[str, ...]) -> None:
    said = [each for text in texts for each in sentences(text.split(" Details: ")[0])]
    assert [each for each in said if len(numbers_of(each)) > MOST_NUMBERS] == []


def test_no_word_is_one_to_avoid(texts: tuple[str, ...]) -> None:
    avoided = re.compile(rf"\b({'|'.join(map(re.escape, AVOIDED))})\b", re.IGNORECASE)
    assert [found.group() for text in texts if (found := avoided.search(text))] == []


def test_a_number_has_no_more_digits_than_its_interval(texts: tuple[str, ...]) -> None:
    """Both to two significant digits of the half width, as `rounded` writes them."""
    pairs = [pair for text in texts for pair in re.findall(r"([+-]?[\d.]+) ± ([\d.]+)", text)]
    assert len(pairs) > 10
    for value, half in pairs:
        assert value.partition(".")[2].__len__() == half.partition(".")[2].__len__(), (value, half)
        assert len(half.replace(".", "").lstrip("0").rstrip("0") or "0") <= 2, (value, half)


def test_the_document_of_an_alert_names_what_it_leads_with(store: Store) -> None:
    alert = store.alerts.list_all(NUMBER_OF["loss"])[-1].alert
    document = alert_document(alert)
    assert document["urgency"] == "today"
    assert str(document["message"]).startswith(f"{document['state']} {document['action']}")
    assert asdict(Lead.of(alert.message)).keys() <= document.keys()
