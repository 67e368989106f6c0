"""Counts that may only fall: numeric constants, and docstrings under an ignore of ruff.

Both are explained in docs/decisions/0001-counts-and-the-walk-of-a-stranger.md. When a count has
fallen, write the new one here in the same commit, so that it cannot rise again.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("shm", "cli/shm_cli", "daemon/shm_daemon")

NUMERIC_CONSTANTS = 1084
DOCSTRING_ERRORS = 890


def is_number(value: ast.expr) -> bool:
    """Return True for a number, a calculation with numbers, or a group of these."""
    match value:
        case ast.Constant():
            return isinstance(value.value, int | float) and not isinstance(value.value, bool)
        case ast.UnaryOp():
            return is_number(value.operand)
        case ast.BinOp():
            return is_number(value.left) and is_number(value.right)
        case ast.Tuple() | ast.List() | ast.Set():
            return bool(value.elts) and all(is_number(each) for each in value.elts)
    return False


def count_numeric_constants(source: str) -> int:
    """Count the names that a module assigns a number at its top level."""
    n_constants = 0
    for node in ast.parse(source).body:
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
            continue
        target = node.targets[0] if isinstance(node, ast.Assign) else node.target
        unpacks = isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple)
        values = node.value.elts if unpacks else [node.value]
        n_constants += sum(is_number(value) for value in values)
    return n_constants


def count_docstring_errors(folder: Path) -> int:
    """Count the docstrings that break a rule of ruff where pyproject.toml ignores it."""
    command = (
        *(sys.executable, "-m", "ruff", "check", "--isolated", "--no-cache", "--quiet"),
        *("--select", "D205,D400,D401", "--output-format", "concise", "."),
    )
    checked = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert checked.returncode in (0, 1), checked.stderr
    return sum(" D" in line for line in checked.stdout.splitlines())


@pytest.mark.parametrize(
    ("source", "count"),
    [
        ("A = 3\nB: float = -4.0\nC, D = 60 * 60, (1, 2)\n", 4),
        ("A = True\nB = 'x'\nC = f(3)\nD: int\n", 0),
        ("def f():\n    A = 3\n", 0),
    ],
)
def test_count_numeric_constants(source: str, count: int) -> None:
    assert count_numeric_constants(source) == count


def test_count_docstring_errors(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text('def f():\n    """Returns f"""\n\n\ndef g():\n    """Fit."""\n')
    assert count_docstring_errors(tmp_path) == 2  # no full stop, not imperative


def test_numeric_constants_only_fall() -> None:
    files = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
    count = sum(count_numeric_constants(path.read_text(encoding="utf-8")) for path in files)
    assert count <= NUMERIC_CONSTANTS, (
        "A number was added at module level. Make it an option with a default, or a row of a "
        "table of limits with unit and source."
    )
    assert count == NUMERIC_CONSTANTS, f"Fewer constants: set NUMERIC_CONSTANTS = {count}."


def test_docstring_errors_only_fall() -> None:
    count = count_docstring_errors(ROOT)
    assert count <= DOCSTRING_ERRORS, (
        "A docstring was added whose first line is no sentence with a verb and an object. "
        "Compare `ruff check --isolated --select D205,D400,D401` with the last commit."
    )
    assert count == DOCSTRING_ERRORS, f"Fewer errors: set DOCSTRING_ERRORS = {count}."
