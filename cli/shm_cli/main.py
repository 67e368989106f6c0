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
from shm.errors import DISK_FULL, BadInput, ShmError, suggest
from shm.resources import one_thread_a_process
from shm_cli import errors
from shm_cli.terminal import Terminal, cleaned_output, escape_controls

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

_LISTING = "shm_cli.listing"


@dataclass(frozen=True)
class Verb:
    """One verb: the module that holds it, a line for the list of verbs, its name in the module."""

    module: str
    summary: str
    name: str = "command"


GROUPS: dict[str, dict[str, Verb]] = {
    "Start": {
        "init": Verb("shm_cli.init", "Make a workspace for a bridge."),
        "demo": Verb("shm_cli.demo", "Run everything on a simulated bridge of 20 hangers."),
        "import": Verb(
            "shm_cli.import_file",
            "Take in the first file of a logger; asks what it does not say.",
        ),
        "ingest": Verb(
            "shm_cli.ingest",
            "Take in files of known loggers; --peek looks, --again redoes.",
        ),
    },
    "Look": {
        "status": Verb("shm_cli.status", "Show the state of every hanger and of the workspace."),
        "report": Verb(
            "shm_cli.report", "Print the state of a hanger or the bridge, or write its report."
        ),
        "drift": Verb("shm_cli.drift", "Show how far tension and stiffness have moved."),
        "alerts": Verb("shm_cli.alerts", "Show alerts and their deliveries; acknowledge them."),
        "gap": Verb("shm_cli.gap", "Find out why model and measurement differ."),
        "bridges": Verb(
            "shm_cli.checkup",
            "Show the state of this bridge and of the others of bridge.toml.",
            "bridges",
        ),
        "audit": Verb("shm_cli.records", "Show who changed what, and when.", "audit"),
        "note": Verb(
            "shm_cli.records", "Record notes, inspections and repairs of a hanger.", "note"
        ),
    },
    "Serve": {
        "daemon": Verb("shm_cli.services", "Watch the spool and process every file.", "daemon"),
        "web": Verb("shm_cli.services", "Serve the dashboard and its API.", "web"),
        "stream": Verb("shm_cli.stream", "Show permanent sensors: what is live, what was lost."),
        "user": Verb("shm_cli.access", "Manage the people who may sign in.", "user"),
        "token": Verb("shm_cli.access", "Manage tokens for access over the network.", "token"),
    },
    "Files alone": {
        "acquire": Verb(
            "shm_cli.acquire", "Guide a hammer test: levels, when to hit, and which hits count."
        ),
        "identify": Verb("shm_cli.identify", "Identify the modes of recordings."),
        "select": Verb(
            "shm_cli.update",
            "Infer the tension with all model classes, and compare them.",
            "select_command",
        ),
        "update": Verb("shm_cli.update", "Infer tension and end stiffness with one model class."),
        "predict": Verb("shm_cli.predict", "Predict the frequencies of a model class."),
        "simulate": Verb("shm_cli.simulate", "Simulate hammer tests of a hanger."),
        "export": Verb("shm_cli.export", "Export posterior samples for other programs."),
    },
    "Upkeep": {
        "db": Verb("shm_cli.db", "Upgrade, check, back up, restore or copy the store."),
        "archive": Verb("shm_cli.archive", "Limit the size of the archive."),
        "settings": Verb(
            "shm_cli.installation", "List every setting with default and range.", "settings_command"
        ),
        "doctor": Verb("shm_cli.checkup", "Check the installation and the workspace.", "doctor"),
        "completion": Verb("shm_cli.completion", "Print the completion script of bash or zsh."),
        "manual": Verb("shm_cli.installation", "Print where the manual is.", "manual_command"),
        "notices": Verb(
            "shm_cli.installation", "List installed packages and licences.", "notices_command"
        ),
    },
}
VERBS = {name: verb for group in GROUPS.values() for name, verb in group.items()}


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
        gc.freeze()  # or the first collection would look through all modules after all
        gc.enable()
        _take_workspace(command)
        _clean_output(command)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the verb; raises click.UsageError that names the nearest one."""
        if args[0] in VERBS or args[0].startswith("-") or ctx.resilient_parsing:
            return super().resolve_command(ctx, args)
        nearest = suggest(args[0], VERBS)
        raise click.UsageError(f"No such command {args[0]!r}. {nearest}".rstrip(), ctx)

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        ctx.meta[_LISTING] = True
        return super().shell_complete(ctx, incomplete)

    def format_help(self, ctx: click.RichContext, formatter: click.RichHelpFormatter) -> None:  # type: ignore[override]
        ctx.meta[_LISTING] = True
        super().format_help(ctx, formatter)


def _in_panels(group: click.Group) -> click.Group:
    """Show the verbs of `shm --help` in their groups."""
    for title, verbs in GROUPS.items():
        group = click.command_panel(title, commands=list(verbs))(group)
    return group


@_in_panels
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
    """Infer the tension of bridge hangers from hammer tests or permanent sensors, unattended.

    \b
    Example: shm --workspace arch report --hanger 3
    """
    ctx.obj = workspace


def _take_workspace(command: click.Command) -> None:
    """Let `--workspace` follow the verb, too."""
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
    """Run the command line and exit with the code of the contract."""
    # Modules are no garbage: looking through them, while they load and at the end, takes a fifth
    # of the time of `shm status`.
    gc.disable()
    atexit.register(gc.freeze)
    one_thread_a_process()
    warnings.showwarning = _warn
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    sys.exit(run(arguments))


def run(arguments: Sequence[str]) -> int:
    """Run one command and return its exit code; an error is reported on stderr.

    With --json the error is a document on stdout too, unless a command has printed its own.
    """
    errors.printed_documents.clear()
    try:
        result = cli.main(list(arguments), prog_name="shm", standalone_mode=False)
    except click.ClickException as error:
        errors.add_suggestion(error)
        vars(error)["message"] = escape_controls(error.message)
        error.show()
        failure = errors.of_click(error)
    except ShmError as error:
        _say(f"[bold red]Error:[/] {escape(str(error))}")
        failure = errors.of_shm(error)
    except (click.Abort, KeyboardInterrupt):
        _say("Stopped.")
        return 130
    except Exception as error:
        if "--debug" in arguments:
            raise
        if isinstance(error, OSError) and error.filename is not None:
            failure = errors.of_shm(_about_file(error))
            _say(f"[bold red]Error:[/] {escape(f'{failure.message} {failure.remedy}')}")
        elif isinstance(error, OSError) and error.errno in DISK_FULL:
            _say("[bold red]Error:[/] no room is left where the answer goes. Make some.")
            return BadInput.exit_code
        else:
            failure = errors.of_unexpected(error)
            _say(f"[bold red]{escape(failure.message)}[/]")
            _say(failure.remedy)
    else:
        return result if isinstance(result, int) else 0
    if "--json" in arguments and not errors.printed_documents:
        click.echo(escape_controls(failure.document()))
    return failure.exit_code


def _about_file(error: OSError) -> BadInput:
    """Return the error of a file or folder that the system refuses to open or to make."""
    return BadInput(
        f"{error.filename}: {(error.strerror or 'it cannot be used').lower()}.",
        remedy="Check the path, that its folder is there, that you may read and write it, and that "
        "the disk has room.",
    )


def _warn(message: Warning | str, *where: object, **_: object) -> None:
    """Return a warning without the place in the code that Python adds."""
    _say(f"[bold yellow]Warning:[/] {escape(str(message))}")


def _say(text: str) -> None:
    Terminal(stderr=True, highlight=False).print(text, soft_wrap=True)
