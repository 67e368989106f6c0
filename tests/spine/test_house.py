"""The house rules that tools do not check: errors, resources, names of the outside."""

from __future__ import annotations

import ast
import importlib
import inspect
import re
import subprocess
from functools import cache
from pathlib import Path

import pytest

from shm import errors
from shm.resources import default_config, migrations_folder

ROOT = Path(__file__).resolve().parents[2]
SOURCES = [path for room in ("shm", "daemon", "cli") for path in (ROOT / room).rglob("*.py")]


@cache
def parse(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def tracked() -> list[Path]:
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if listed.returncode:
        pytest.skip("not a git checkout: the tracked files are not known")
    return [ROOT / name for name in listed.stdout.split("\0") if name and (ROOT / name).is_file()]


def test_every_error_has_an_exit_code_of_the_contract() -> None:
    classes = [c for c in vars(errors).values() if isinstance(c, type)]
    codes = {c.__name__: c.exit_code for c in classes if issubclass(c, errors.ShmError)}
    assert codes["UsageError"] == 2
    assert codes["BadInput"] == codes["NotIdentifiable"] == 3
    assert codes["NothingThere"] == 4
    assert codes["StoreError"] == codes["SchemaOutdated"] == codes["StoreBusy"] == 5
    assert codes["GateNotMet"] == 6
    for name in codes:
        assert name in (errors.__doc__ or "")


def test_an_error_says_where_and_what_to_do() -> None:
    error = errors.BadInput(
        "NaN.", file="/data/a.csv", channel="acc_1", line=7, remedy="Check the cable."
    )
    assert str(error) == "a.csv, line 7, channel acc_1: NaN. Check the cable."


def test_what_an_error_quotes_does_not_end_it_twice() -> None:
    """Of a full stop in the quoted text and our own, one stays."""
    assert errors.BadInput(f"cannot be read: {errors.ShmError('no line 3.')}.").message == (
        "cannot be read: no line 3."
    )
    assert [errors.sentence(text) for text in ("a", "a.", "a..", "a?")] == ["a.", "a.", "a.", "a?"]


def test_no_command_in_a_message_has_a_placeholder_for_what_shm_knows() -> None:
    """What was damaged, held or is still open has a name; docstrings may say ID."""
    unknown = re.compile(r"`shm [^`]*(--(again|confirm|discard|of|hanger)|ack|fetch) ([A-Z]+)\b")
    found = [
        f"{path.name}: {node.value}"
        for path in SOURCES
        if "`shm " in path.read_text(encoding="utf-8")
        for tree in [parse(path)]
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
        if unknown.search(node.value) and not _is_docstring(node, tree)
    ]
    assert not found


def _is_docstring(node: ast.Constant, tree: ast.Module) -> bool:
    return any(isinstance(each, ast.Expr) and each.value is node for each in ast.walk(tree))


def test_a_full_disk_is_told_by_its_codes_in_one_place() -> None:
    assert [p.name for p in SOURCES if "errno.ENOSPC" in p.read_text()] == ["errors.py"]


def test_packaged_files_are_found() -> None:
    assert (migrations_folder() / "env.py").is_file()
    assert default_config().is_file()


def test_no_function_is_longer_than_50_lines() -> None:
    long = []
    for path in SOURCES:
        for node in ast.walk(parse(path)):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                first = node.body[1:] if ast.get_docstring(node) else node.body
                if first and first[-1].end_lineno - first[0].lineno + 1 > 50:
                    long.append(f"{path.name}:{node.name}")
    assert not long


ROOMS = (
    "read",
    "identify",
    "models",
    "inference",
    "watch",
    "store",
    "report",
    "simulate",
    "pipeline",
    "plausibility",
    "monitor",
)


def _named(module: str, name: str) -> object:
    """Return what `from module import name` gives, a module of a package too."""
    found = importlib.import_module(module)
    return (
        getattr(found, name)
        if hasattr(found, name)
        else importlib.import_module(f"{module}.{name}")
    )


def _asked_of(room: str) -> dict[str, object]:
    """Return what higher layers import from the files of a room without `__all__`."""
    if hasattr(importlib.import_module(f"shm.{room}"), "__all__"):
        return {}
    above = [
        node
        for folder in ("cli/shm_cli", "daemon/shm_daemon", "shm/pipeline", "shm/api")
        for path in (ROOT / folder).rglob("*.py")
        if f"shm.{room}." in path.read_text(encoding="utf-8")
        for node in ast.walk(parse(path))
    ]
    return {
        alias.name: _named(node.module, alias.name)
        for node in above
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(f"shm.{room}.")
        for alias in node.names
        if node.module
    }


@pytest.mark.parametrize("room", ROOMS)
def test_what_a_room_offers_is_documented(room: str) -> None:
    module = importlib.import_module(f"shm.{room}")
    offered = {name: getattr(module, name) for name in getattr(module, "__all__", ())}
    offered |= _asked_of(room)
    assert offered
    bare = [
        name
        for name, thing in offered.items()
        if (inspect.isclass(thing) or inspect.isfunction(thing))
        and (not thing.__doc__ or thing.__doc__.startswith(f"{name}("))
    ]
    assert module.__doc__
    assert not bare


def test_nothing_committed_names_a_registry_host_or_a_path_of_a_machine() -> None:
    forbidden = re.compile(r"pypi\.org|pythonhosted|/work/|/root/|file://")
    found = [
        f"{path.name}: {match.group()}"
        for path in tracked()
        if path.suffix not in {".db", ".uff"} and path != Path(__file__)
        for match in [forbidden.search(path.read_text(encoding="utf-8", errors="replace"))]
        if match
    ]
    assert not found
