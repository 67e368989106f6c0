"""`shm completion`: the script by which a shell completes `shm`."""

from __future__ import annotations

import rich_click as click
from click.shell_completion import get_completion_class

_VARIABLE = "_SHM_COMPLETE"


@click.command()
@click.argument("shell", type=click.Choice(["bash", "zsh"]))
@click.pass_context
def command(ctx: click.Context, shell: str) -> None:
    """Print the script that completes `shm` in bash or zsh.

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
