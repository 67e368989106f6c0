"""Makes the generated pages: commands, settings, effects, and the tables of other pages.

The pages of commands, settings, effects, the thesis and the Python reference are built here and not
kept in the repository: `shm VERB --help`, `shm settings`, `shm gap effects`,
`python tests/benchmarks/validate.py --list` and `help(shm)` say the same.

python docs/build.py --quick    # what follows from the code alone; `make docs` does this first
python docs/build.py            # the computed tables too: validation, hanger 3

`python tests/benchmarks/blind_trial.py DIR --write-docs` fills the page of the blind trial.
The real measurements are not in this repository; docs/real_cases_page.py fills their page in two
minutes where they are.
"""

from __future__ import annotations

import ast
import csv
import inspect
import re
import runpy
import sys
import textwrap
from collections.abc import Mapping
from inspect import Signature, signature
from pathlib import Path

import rich_click as click

from docs import validation_page
from docs.command_pages import effects_page, licences_page, settings_page
from docs.filling import fill_in
from docs.gap_page import hanger_3_table
from docs.house import house
from shm import api
from shm.models.classes.registry import MODELS
from shm_cli.common import markdown
from shm_cli.main import VERBS, cli
from tests.benchmarks.thesis import frequencies, selection, thesis_data
from tests.benchmarks.validate import compared

DOCS = Path(__file__).parent


def commands_page() -> str:
    """Return docs/commands.md from the help texts."""
    parts = [
        "# Commands\n\nMade by `make docs` from the help texts; `shm VERB --help` says the same."
    ]
    with click.Context(cli, info_name="shm", **cli.context_settings) as context:
        for verb in VERBS:
            command = cli.get_command(context, verb)
            assert command is not None
            parts.append(_command(command, f"shm {verb}", context))
    return "\n\n".join(parts) + "\n"


def _command(command: click.Command, name: str, parent: click.Context) -> str:
    lines = [f"## {name}", _prose(command.help or "")]
    with click.Context(command, info_name=name.split()[-1], parent=parent) as context:
        for parameter in command.params:
            record = parameter.get_help_record(context)
            if record:
                lines.append(f"- `{record[0]}`: {record[1]}" if record[1] else f"- `{record[0]}`")
        if isinstance(command, click.Group):
            lines += [
                _command(inner, f"{name} {key}", context) for key, inner in command.commands.items()
            ]
    return "\n\n".join(lines)


def _prose(text: str) -> str:
    cleaned = re.sub(r"^\s*\x08\s*\n", "", inspect.cleandoc(text), flags=re.MULTILINE)
    return re.sub(r"Example: (.+)", r"Example: `\1`", cleaned)


def thesis_page() -> str:
    """Return docs/thesis.md: every item of the thesis and its counterpart here."""
    said = (
        "# The thesis, item by item\n\nMade by `make docs`; "
        "`python tests/benchmarks/validate.py --list` says the same."
    )
    rows = [(each["of"], each["what"], _linked(each["where"])) for each in thesis_data.checklist()]
    return f"{said}\n\n{markdown(('of the thesis', 'what', 'ours'), rows)}\n"


def _linked(where: str) -> str:
    """Return a command as code, a page as a link, a reason unchanged."""
    if where.startswith(("shm ", "python ")):
        return f"`{where}`"
    page = where.removeprefix("docs/")
    return f"[{page}]({page})" if where.startswith("docs/") else where


def classes_table() -> str:
    """Return the model classes of docs/physics.md: title, parameters and ranges."""
    head = ("class", "what it is", "parameters, each with its range")
    rows = [
        (f"[`{name}`](#{_heading(name)})", model.title.partition(": ")[2], _ranges(model.bounds))
        for name, model in MODELS.items()
    ]
    return markdown(head, rows)


def examples() -> str:
    """Return the programs of docs/examples for docs/api.md: title, purpose, and their core."""
    parts = []
    for path in sorted((DOCS / "examples").glob("*.py")):
        text = path.read_text(encoding="utf-8")
        purpose = (ast.get_docstring(ast.parse(text)) or "").splitlines()[0]
        number, _, name = path.stem.partition("_")
        title = f"{int(number)}. {name.replace('_', ' ').capitalize()}"
        link = f"[The complete program](examples/{path.name})."
        picture = f"![{title[3:].strip()}](static/examples/{path.stem}.png)"
        core = f"```python\n{_core(text)}\n```"
        parts.append(f"### {title}\n\n{purpose} {link}\n\n{core}\n\n{picture}")
    return "\n" + "\n\n".join(parts) + "\n"


def draw_examples() -> None:
    """Run the programs of docs/examples and keep the figure of each for docs/api.md."""
    folder = DOCS / "static" / "examples"
    folder.mkdir(exist_ok=True)
    for path in sorted((DOCS / "examples").glob("*.py")):
        figure = runpy.run_path(str(path), run_name="__main__")["figure"]
        figure.savefig(folder / f"{path.stem}.png", dpi=70)


def _core(program: str) -> str:
    """Return the lines of an example that the manual shows."""
    found = re.search(
        r"^ *# Shown in the manual from here\.\n(.*?)\n *# Shown in the manual until here\.$",
        program, re.M | re.S,
    )  # fmt: skip
    if found is None:
        raise SystemExit("Mark the core of each example: # Shown in the manual from here.")
    return textwrap.dedent(found[1])


_FUNCTIONS = (
    "load_hanger", "round_bar", "read", "load_modes", "simulate", "identify", "update", "select",
    "diagnose", "check_gap", "diagnose_simulator",
)  # fmt: skip


def functions() -> str:
    """Return the calls of the Python front for docs/api.md, each with its purpose."""
    lines = []
    for name in _FUNCTIONS:
        function = getattr(api, name)
        purpose = (inspect.getdoc(function) or "").splitlines()[0]
        parameters = signature(function).parameters
        plain = [p.replace(annotation=p.empty) for n, p in parameters.items() if n != "progress"]
        call = f"shm.{name}{Signature(plain)}"
        lines += [f"# {purpose}", *textwrap.wrap(call, 100, subsequent_indent="    "), ""]
    return "```python\n" + "\n".join(lines).rstrip() + "\n```"


def reference_page() -> str:
    """Return docs/reference.md, which Sphinx fills from the docstrings."""
    names = [f".. autofunction:: shm.api.{name}" for name in _FUNCTIONS]
    modules = [f".. automodule:: {name}\n   :members:" for name in ("shm.plot", "shm.export")]
    store = ".. autoclass:: shm.api.Store\n   :members:"
    head = "# Python reference\n\nMade by `make docs`; `help(shm.update)` says the same.\n"
    return f"{head}\n```{{eval-rst}}\n" + "\n\n".join([*names, store, *modules]) + "\n```\n"


_SOLIDS = ("s1", "s2", "solid0", "solid1", "solid2")
_HEADINGS = {
    "beam1": "beam1-clamped-ends",
    "beam2": "beam2-ends-on-rotational-springs",
    "beam3": "beam3-shear-and-rotary-inertia",
    **dict.fromkeys(_SOLIDS, "s1-s2-solid0-solid1-solid2-three-dimensional"),
}
"""Under which heading of docs/physics.md each class stands."""


def _heading(name: str) -> str:
    if name not in _HEADINGS:
        raise SystemExit(f"Say under which heading of docs/physics.md {name} stands: _HEADINGS.")
    return _HEADINGS[name]


def _ranges(bounds: Mapping[str, tuple[float, float]]) -> str:
    """Return the ranges of parameters; those with the same range are named together."""
    alike: dict[tuple[float, float], list[str]] = {}
    for name, both in bounds.items():
        alike.setdefault(both, []).append(f"`{name}`")
    return "; ".join(
        f"{', '.join(names)} {low:g} to {high:g}" for (low, high), names in alike.items()
    )


def main() -> None:
    """Write the pages; with --figures the pictures of the examples, too, with --quick no tables."""
    if "--figures" in sys.argv:
        draw_examples()
    (DOCS / "commands.md").write_text(commands_page(), encoding="utf-8")
    (DOCS / "settings.md").write_text(settings_page(), encoding="utf-8")
    (DOCS / "licences.md").write_text(licences_page(), encoding="utf-8")
    (DOCS / "effects.md").write_text(effects_page(), encoding="utf-8")
    (DOCS / "thesis.md").write_text(thesis_page(), encoding="utf-8")
    fill_in(DOCS / "physics.md", "classes", classes_table())
    (DOCS / "reference.md").write_text(reference_page(), encoding="utf-8")
    fill_in(DOCS / "api.md", "examples", examples())
    fill_in(DOCS / "api.md", "functions", functions())
    fill_in(DOCS.parent / "CONTRIBUTING.md", "house", house())
    head, *rows = csv.reader((DOCS / "trials/proof.csv").read_text().splitlines())
    fill_in(DOCS / "trials/validation.md", "proof", markdown(head, rows))
    if "--quick" in sys.argv:
        return
    tables, chosen = compared(seed=1)
    validation_page.write([*map(frequencies.cells, tables)], [*map(selection.cells, chosen)])
    fill_in(DOCS / "trials/real_cases.md", "hanger 3", hanger_3_table())


if __name__ == "__main__":
    main()
