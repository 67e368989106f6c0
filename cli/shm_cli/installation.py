"""`shm settings`, `shm manual`, `shm notices`: what an installation holds."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path

import rich_click as click

from shm.errors import NothingThere, UsageError
from shm.resources import manual
from shm.settings import TABLE, Setting
from shm_cli import flags
from shm_cli.assumed import show_assumptions
from shm_cli.common import answer, show, show_rows

SETTING_HEADS = ("setting", "default", "unit", "range", "meaning")


@click.command("settings")
@click.option(
    "--assumptions",
    is_flag=True,
    help="Instead the physical assumptions: mass of a sensor, stiffness of ends, tolerances ...",
)
@flags.hanger()
@flags.hanger_file
@flags.json
def settings_command(assumptions: bool, hanger_id: int | None, hanger_file: Path | None) -> None:
    """List every setting with default and range.

    A value comes from the flag, else the environment (`workers` from SHM_WORKERS), else
    `[settings]` of `bridge.toml`, else the default. With --assumptions: the assumptions on hangers,
    sensors and measurements, from `[assumptions]` of `bridge.toml`, else the default; of a hanger
    with --hanger or --hanger-file.

    \b
    Example: shm settings
    Example: shm settings --assumptions
    """
    if assumptions:
        show_assumptions(hanger_file, hanger_id, flags.wants_json())
    elif hanger_file is not None or hanger_id is not None:
        raise UsageError(
            "settings are those of the bridge, not of one hanger.",
            remedy="Add --assumptions, or leave the hanger out.",
        )
    elif flags.wants_json():
        show({"settings": [_document(row) for row in TABLE]})
    else:
        show_rows("", SETTING_HEADS, [(row.name, *setting_cells(row)) for row in TABLE])


@click.command("manual")
@flags.json
def manual_command() -> None:
    """Print where the manual is.

    Open the printed file in a browser. It needs no network.

    \b
    Example: shm manual
    """
    page = manual()
    if not page.is_file():
        raise NothingThere(
            "this installation came without the manual.",
            remedy="Install the wheel of `make wheel`, run `make docs`, or read docs/index.md.",
        )
    answer({"page": str(page)}, str(page))


def setting_cells(row: Setting) -> tuple[str, ...]:
    return str(row.default), row.unit, _range(row), row.help


def _range(row: Setting) -> str:
    bounds = (
        ", ".join(row.choices),
        "" if row.low is None else f"from {row.low:g}",
        "" if row.high is None else f"to {row.high:g}",
    )
    return " ".join(text for text in bounds if text)


def _document(row: Setting) -> dict[str, object]:
    return {
        "setting": row.name,
        "default": row.default,
        "unit": row.unit,
        "choices": list(row.choices),
        "from": row.low,
        "to": row.high,
        "environment": row.environment_variable,
        "meaning": row.help,
    }


_REQUIREMENT = re.compile(r"([\w.-]+)\s*(?:\[([^\]]*)\])?[^;]*;?(.*)")
_ONLY_FOR = re.compile(r"""extra\s*==\s*['"]([\w.-]+)['"]""")
_NOT_AT_WORK = {"dev", "build"}


@dataclass(frozen=True)
class Notice:
    """One package, its licence as the package declares it, and the extra of shm that brings it."""

    package: str
    version: str
    licence: str
    extra: str


@click.command("notices")
@flags.json
def notices_command() -> None:
    """List installed packages and licences.

    Those of an extra, such as `web`, are listed where they are installed. The texts of the licences
    lie in each package's own folder of the installation.

    \b
    Example: shm notices
    """
    found = notices()
    if flags.wants_json():
        show({"packages": [asdict(each) for each in found]})
    else:
        heads = ("package", "version", "licence", "extra")
        show_rows("", heads, [(e.package, e.version, e.licence, e.extra) for e in found])


def notices() -> Sequence[Notice]:
    """Return every installed package that shm requires, directly or not, with its extras."""
    found: dict[str, Notice] = {}
    _gather("shm", (), "", found)
    for extra in metadata.metadata("shm").get_all("Provides-Extra") or ():
        if extra not in _NOT_AT_WORK:
            _gather("shm", (extra,), extra, found)
    return sorted(found.values(), key=lambda each: (each.extra, each.package.lower()))


def _gather(name: str, chosen: Collection[str], extra: str, found: dict[str, Notice]) -> None:
    for text in metadata.requires(name) or ():
        needed = _REQUIREMENT.match(text)
        assert needed is not None
        package, its_extras, condition = needed.groups()
        key = re.sub(r"[-_.]+", "-", package).lower()  # one name is spelled in several ways
        only_for = _ONLY_FOR.search(condition)
        if key in found or (only_for and only_for[1] not in chosen):
            continue
        try:
            fields = metadata.metadata(package)
        except metadata.PackageNotFoundError:  # of another system, or of an extra that is not here
            continue
        licence = _declared(fields)
        found[key] = Notice(fields["Name"], fields["Version"], licence, extra)
        _gather(package, re.findall(r"[\w.-]+", its_extras or ""), extra, found)


def _declared(fields: metadata.PackageMetadata) -> str:
    classifiers = [c for c in fields.get_all("Classifier") or () if c.startswith("License ::")]
    names = [c.rpartition(" :: ")[2] for c in classifiers if c != "License :: OSI Approved"]
    # A licence given as its whole text names the licences of others: its first line is its own.
    written = [text.strip().partition("\n")[0] for text in fields.get_all("License") or ()]
    return "; ".join(fields.get_all("License-Expression") or names or written)
