"""What templates do to text."""

from __future__ import annotations

from shm.report.as_html import with_code


def test_commands_are_set_as_code_and_nothing_else_is_let_through() -> None:
    told = with_code("Run `shm ingest <file>`, <b>then</b> look; a ` alone stays.")
    assert told == (
        "Run <code>shm ingest &lt;file&gt;</code>, &lt;b&gt;then&lt;/b&gt; look; a ` alone stays."
    )
