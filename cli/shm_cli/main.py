"""The console script `shm`: finds the verb, loads it alone, and turns errors into exit codes."""

from __future__ import annotations

import atexit
import gc
import sys
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

import rich_click as click
from rich.markup import escape

from shm import __version__
from shm.errors import DISK_FULL, BadInput, ShmError
from shm.resources import one_thread_a_process
from shm_cli.terminal import Terminal, cleaned_output, escape_controls

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

UNEXPECTED = 1
_LISTING = "shm_cli.listing"


@dataclass(frozen=True)
class Verb:
    """One verb: the module that holds it, a line for the list of verbs, its name in the module."""

    module: str
    summary: str
    name: str = "command"


VERBS: dict[str, Verb] = {
    "init": Verb("shm_cli.init", "Make a workspace for a bridge."),
    "demo": Verb("shm_cli.demo", "See the whole job on a simulated bridge of 20 hangers."),
    "import": Verb(
        "shm_cli.import_file",
        "Take a logger's file in for the first time, asking only what it does not say.",
    ),
    "ingest": Verb(
        "shm_cli.ingest",
        "Take recordings in, look into them with --peek, or do one again with --again.",
    ),
    "stream": Verb("shm_cli.stream", "Permanent sensors: what is live, and what was lost."),
    "daemon": Verb(
        "shm_cli.services", "Watch the spool and do the whole job, unattended.", "daemon"
    ),
    "web": Verb(
        "shm_cli.services",
        "The dashboard and its API: pages for people, upload, alerts, health and metrics.",
        "web",
    ),
    "token": Verb("shm_cli.access", "Who may read and write over the network.", "token"),
    "user": Verb("shm_cli.access", "People who may sign in to the dashboard.", "user"),
    "note": Verb(
        "shm_cli.records", "Notes, inspections and repairs of a hanger or of the bridge.", "note"
    ),
    "audit": Verb("shm_cli.records", "Who changed what, when and how: the newest first.", "audit"),
    "identify": Verb("shm_cli.identify", "Modal parameters of recordings."),
    "predict": Verb("shm_cli.predict", "Frequencies of a model class for given parameters."),
    "update": Verb("shm_cli.update", "Posterior of tension and end stiffness."),
    "select": Verb("shm_cli.update", "Compare model classes by their evidence.", "select_command"),
    "gap": Verb("shm_cli.gap", "Why model and measurement differ, and what that does to tension."),
    "report": Verb(
        "shm_cli.report", "Print the state of a hanger or the bridge, or write its report."
    ),
    "drift": Verb("shm_cli.drift", "How far tension and stiffness have moved."),
    "alerts": Verb("shm_cli.alerts", "Alerts that were raised, and their deliveries."),
    "simulate": Verb("shm_cli.simulate", "Hammer tests of a hanger whose truth you choose."),
    "export": Verb(
        "shm_cli.export", "Posterior samples of the selected model class for other programs."
    ),
    "db": Verb("shm_cli.db", "Upgrade, check, back up, restore or copy the store."),
    "archive": Verb(
        "shm_cli.archive", "Keep the archive and the quarantine from growing for ever."
    ),
    "doctor": Verb(
        "shm_cli.checkup", "Whether all is well, and what to do where it is not.", "doctor"
    ),
    "status": Verb("shm_cli.status", "What the workspace holds and what waits."),
    "bridges": Verb(
        "shm_cli.checkup",
        "How this bridge and the others of bridge.toml are, the worst first.",
        "bridges",
    ),
    "settings": Verb(
        "shm_cli.installation",
        "Every setting: its default, its range, what it means.",
        "settings_command",
    ),
    "notices": Verb(
        "shm_cli.installation",
        "Other people's packages that work here, with the licence that each declares.",
        "notices_command",
    ),
    "completion": Verb(
        "shm_cli.completion", "Print the script that completes `shm` in bash or zsh."
    ),
}


class Verbs(click.RichGroup):
    """Loads a verb's module only when that verb is called, so that `shm --help` is quick."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(VERBS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in VERBS:
            return None
        if _LISTING in ctx.meta:
            return click.RichCommand(name=cmd_name, help=VERBS[cmd_name].summary)
        verb = VERBS[cmd_name]
        command: click.Command = getattr(import_module(verb.module), verb.name)
        gc.enable()
        _take_workspace(command)
        _clean_output(command)
        return command

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        ctx.meta[_LISTING] = True
        return super().shell_complete(ctx, incomplete)

    def format_help(self, ctx: click.RichContext, formatter: click.RichHelpFormatter) -> None:  # type: ignore[override]
        ctx.meta[_LISTING] = True
        super().format_help(ctx, formatter)


@click.group(
    cls=Verbs, context_settings={"help_option_names": ["-h", "--help"], "show_default": True}
)
@click.option(
    "--workspace",
    metavar="DIR",
    envvar="SHM_WORKSPACE",
    default=".",
    show_default="$SHM_WORKSPACE, else the current folder",
    help="The folder of the bridge.",
)
@click.option("--debug", is_flag=True, help="Show the traceback of an unexpected error.")
@click.version_option(__version__, prog_name="shm")
@click.pass_context
def cli(ctx: click.Context, workspace: str, debug: bool) -> None:
    """Tension of bridge hangers from hammer tests, with its uncertainty, unattended.

    \b
    Example: shm --workspace arch report --hanger 3
    """
    ctx.obj = workspace


def _take_workspace(command: click.Command) -> None:
    """Lets `--workspace` stand after the verb too."""
    if isinstance(command, click.Group):
        for member in command.commands.values():
            _take_workspace(member)
        if not command.invoke_without_command:
            return
    if not any(parameter.name == "workspace" for parameter in command.params):
        command.params.append(
            click.RichOption(
                ["--workspace"],
                metavar="DIR",
                expose_value=False,
                callback=_use_workspace,
                help="The folder of the bridge.",
            )
        )


def _clean_output(command: click.Command) -> None:
    """Have a command, and all below it, print no control character of anybody's text.

    What is printed while a command line is parsed, help and usage, is ours, and in colours.
    """
    if isinstance(command, click.Group):
        for member in command.commands.values():
            _clean_output(member)
    if command.callback is not None and not hasattr(command.callback, "cleans_output"):
        command.callback = cleaned_output()(command.callback)
        command.callback.cleans_output = True  # type: ignore[attr-defined]


def _use_workspace(ctx: click.Context, option: click.Parameter, folder: str | None) -> None:
    if folder is not None:
        ctx.obj = folder


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line and exits with the code of the contract."""
    # Modules are no garbage: looking through them, while they load and at the end, takes a fifth
    # of the time of `shm status`.
    gc.disable()
    atexit.register(gc.freeze)
    one_thread_a_process()
    warnings.showwarning = _warn
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    sys.exit(run(arguments))


def run(arguments: Sequence[str]) -> int:
    """Runs one command; its exit code. What goes wrong is said on stderr, stdout stays clean."""
    try:
        result = cli.main(list(arguments), prog_name="shm", standalone_mode=False)
    except click.ClickException as error:
        vars(error)["message"] = escape_controls(error.message)
        error.show()
        return error.exit_code
    except ShmError as error:
        _say(f"[bold red]Error:[/] {escape(str(error))}")
        return error.exit_code
    except (click.Abort, KeyboardInterrupt):
        _say("Stopped.")
        return 130
    except Exception as error:
        if "--debug" in arguments:
            raise
        if isinstance(error, OSError) and error.filename is not None:
            _say(f"[bold red]Error:[/] {escape(_about_file(error))}")
            return BadInput.exit_code
        if isinstance(error, OSError) and error.errno in DISK_FULL:
            _say("[bold red]Error:[/] no room is left where the answer goes. Make some.")
            return BadInput.exit_code
        _say(f"[bold red]Unexpected {type(error).__name__}:[/] {escape(str(error))}")
        _say("This is a fault of shm. `shm --debug ...` shows where; please report it.")
        return UNEXPECTED
    return result if isinstance(result, int) else 0


def _about_file(error: OSError) -> str:
    """What a person can do about a file or folder that the system refuses to open or to make."""
    return (
        f"{error.filename}: {(error.strerror or 'it cannot be used').lower()}. Check the path, "
        "that its folder is there, that you may read and write it, and that the disk has room."
    )


def _warn(message: Warning | str, *where: object, **_: object) -> None:
    """A warning without the place in the code that Python adds."""
    _say(f"[bold yellow]Warning:[/] {escape(str(message))}")


def _say(text: str) -> None:
    Terminal(stderr=True, highlight=False).print(text, soft_wrap=True)
