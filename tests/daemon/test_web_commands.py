"""A page links to the page that does what a message names as a shell command."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from shm_daemon.web.commands import set_reader, with_links, without_commands


@pytest.fixture(autouse=True)
def no_hanger() -> Iterator[None]:
    set_reader(None)
    yield
    set_reader(None)


@pytest.mark.parametrize(
    ("text", "link"),
    [
        ("compare the hangers beside it (`shm drift bridge`)", '(<a href="/compare">Compare</a>)'),
        ("Hanger 7: set (`shm drift rebaseline`)", '<a href="/hangers/7/baseline">Baseline</a>'),
        ("for the tension: shm gap diagnose --hanger 18", 'href="/hangers/18/diagnosis"'),
        ("`shm ingest --held`.", '<a href="/operation#held">Held tests</a>.'),
        ("`shm ingest --confirm 37 --time TIME`", '<a href="/operation#held-37">Confirm</a>'),
        ("`shm ingest --discard 37`", '<a href="/operation#held-37">Discard</a>'),
        ("`shm alerts ack 4`", '<a href="/alerts#alert-4">Acknowledge</a>'),
        ("`shm alerts test --hook siren`", 'href="/settings#notifications"'),
        ("its log and `shm doctor` say why", '<a href="/operation#examination">Examination</a>'),
        ("Drop it again with `hanger = 3` in its sidecar", 'href="/upload">Upload it again</a>'),
    ],
)
def test_a_command_becomes_a_link_to_its_page(text: str, link: str) -> None:
    assert link in with_links(text)
    assert "`" not in with_links(text)


@pytest.mark.parametrize("command", ["shm alerts silences", "shm db check", "shm archive fetch"])
def test_a_command_without_a_page_stays_as_code(command: str) -> None:
    assert with_links(f"Run `{command}`.") == f"Run <code>{command}</code>."


def test_a_command_without_a_number_is_of_the_hanger_of_the_page() -> None:
    text = "Once it is explained, set a new baseline (`shm drift rebaseline`)."
    assert "<code>shm drift rebaseline</code>" in with_links(text)
    set_reader(3)
    assert '<a href="/hangers/3/baseline">' in with_links(text)


def test_a_page_for_engineers_is_named_to_others_without_a_link() -> None:
    set_reader(3, is_engineer=False)
    assert with_links("set a new baseline (`shm drift rebaseline`)") == (
        "set a new baseline (Baseline)"
    )
    assert '<a href="/hangers/3/diagnosis">' in with_links("ask `shm gap diagnose`")


def test_words_of_others_are_escaped() -> None:
    assert with_links("<b> `shm status` <i>") == '&lt;b&gt; <a href="/">Bridge</a> &lt;i&gt;'


def test_a_label_names_the_page_without_a_link() -> None:
    assert without_commands("`shm doctor` warns < 7 days") == "Examination warns < 7 days"
