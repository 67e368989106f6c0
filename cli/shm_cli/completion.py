"""Complete `shm` in a shell: its script, and the values of options.

These are hangers, classes, effects and hooks of the workspace.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import rich_click as click
from click.shell_completion import CompletionItem, get_completion_class

from shm.bridge import Bridge, load_bridge
from shm.errors import ShmError

_VARIABLE = "_SHM_COMPLETE"


@click.command()
@click.argument("shell", type=click.Choice(["bash", "zsh"]))
@click.pass_context
def command(ctx: click.Context, shell: str) -> None:
    """Print the completion script of bash or zsh.

    It completes commands, options, the workspace's hangers and hooks, model classes and effects.

    To install it for bash, append this line to ~/.bashrc and open a new terminal:

    \b
        eval "$(shm completion bash)"

    For zsh append this one to ~/.zshrc, below `autoload -Uz compinit && compinit`:

    \b
        eval "$(shm completion zsh)"

    \b
    Example: shm completion bash
    """
    made = get_completion_class(shell)
    assert made is not None, shell
    click.echo(made(ctx.find_root().command, {}, "shm", _VARIABLE).source())


def hangers(
    ctx: click.Context, parameter: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    """Return numbers of the bridge's hangers, with their names."""
    bridge = _bridge(ctx)
    described = bridge.bars if bridge else ()
    return _beginning(incomplete, ((str(each.id), each.name) for each in described))


def streams(
    ctx: click.Context, parameter: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    """Return names of the bridge's streams, with their hangers."""
    bridge = _bridge(ctx)
    described = bridge.streams if bridge else ()
    return _beginning(incomplete, ((each.name, f"hanger {each.hanger}") for each in described))


def hooks(ctx: click.Context, parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Return names of the bridge's hooks, with their kinds."""
    bridge = _bridge(ctx)
    return _beginning(
        incomplete, ((each.name, each.kind) for each in (bridge.hooks if bridge else ()))
    )


def models(ctx: click.Context, parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Return names of model classes; after a comma the next one."""
    from shm.models.classes.registry import MODELS

    *chosen, last = incomplete.split(",")
    before = "".join(f"{name}," for name in chosen)
    offered = ((before + name, "") for name in MODELS if name not in chosen)
    return _beginning(before + last, offered)


def effects(
    ctx: click.Context, parameter: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    """Return names of the catalogue's effects, with their titles."""
    from shm.models.effects import EFFECTS

    return _beginning(incomplete, ((name, effect.title) for name, effect in EFFECTS.items()))


def _beginning(start: str, offered: Iterable[tuple[str, str]]) -> list[CompletionItem]:
    return [
        CompletionItem(value, help=help_text or None)
        for value, help_text in offered
        if value.startswith(start)
    ]


def _bridge(ctx: click.Context) -> Bridge | None:
    """Return the bridge of the workspace given so far; None where it cannot be read."""
    folder = ctx.obj or ctx.find_root().params.get("workspace") or "."
    try:
        return load_bridge(Path(folder) / "bridge.toml")
    except (ShmError, OSError):
        return None
