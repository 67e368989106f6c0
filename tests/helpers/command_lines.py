"""Command lines of help texts and pages, parsed by the real commands and not run."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import click

from shm_cli.main import VERBS, cli

_SUBSTITUTION = re.compile(r"\$\([^)]*\)")


def commands(
    group: click.Group = cli, name: str = "", parent: click.Context | None = None
) -> Iterator[tuple[str, click.Command]]:
    """Every command as it is typed after `shm`, members of groups at any depth too."""
    context = click.Context(group, parent=parent)
    for key in VERBS if group is cli else group.list_commands(context):
        command = group.get_command(context, key)
        assert command is not None
        typed = f"{name} {key}".strip()
        yield typed, command
        if isinstance(command, click.Group):
            yield from commands(command, typed, context)


def examples(command: click.Command) -> list[str]:
    """The lines `Example: shm ...` of a help text, without that word."""
    lines = (line.strip() for line in (command.help or "").splitlines())
    return [line.removeprefix("Example: ") for line in lines if line.startswith("Example: ")]


def words_of(line: str) -> list[str]:
    """The words after `shm` of one line as it is typed; comments, `&` and redirections go."""
    plain = _SUBSTITUTION.sub("SOMETHING", line)
    words = shlex.split(plain, comments=True)
    ends = [words.index(sign) for sign in ("&", "&&", "|", ">", ";") if sign in words]
    return words[1 : min(ends, default=len(words))]


def parse(line: str) -> str:
    """The command that a line calls; raises click.UsageError where it would be refused.

    Files must exist unless a test lets click.Path pass: a page names files of its reader.
    """
    try:
        return _called(line)
    except click.exceptions.Exit:  # --help and --version end the parsing
        return "shm ..."


def _called(line: str) -> str:
    arguments, command, parent, name = words_of(line), cli, None, "shm"
    while True:
        context = command.make_context(name, list(arguments), parent=parent)
        assert isinstance(command, click.Group)
        left = [*context._protected_args, *context.args]
        if not left and command.invoke_without_command:
            return context.command_path
        name, member, arguments = command.resolve_command(context, left)
        assert name is not None
        assert member is not None
        if not isinstance(member, click.Group):
            return member.make_context(name, list(arguments), parent=context).command_path
        command, parent = member, context


def fenced_commands(page: Path) -> list[str]:
    """Every line that calls `shm` in a fenced block of a page, continued lines joined."""
    blocks = re.findall(r"^```(?:sh|bash|console)?\n(.*?)^```$", page.read_text(), re.M | re.S)
    lines = [line.strip() for block in blocks for line in block.replace("\\\n", " ").splitlines()]
    bare = (re.sub(r"^(\$ |\.venv/bin/)", "", line) for line in lines)
    return [line for line in bare if line.startswith("shm ")]


def inline_commands(page: Path) -> list[str]:
    """Every `shm ...` inside a sentence of a page."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.M | re.S)
    return [" ".join(found.split()) for found in re.findall(r"`(shm [^`]+)`", text)]
