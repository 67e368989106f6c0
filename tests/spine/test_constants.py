"""Every number that is written down in the code has its reason beside it."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("shm", "cli/shm_cli", "daemon/shm_daemon")


def without_reason(source: str) -> Iterator[str]:
    """Lines of a module that name a number and do not say why it is that one.

    A reason is a comment in the line or on the lines before it, or a text after it; either may
    serve several lines, with no empty one between.
    """
    lines, body = source.splitlines(), ast.parse(source).body
    texts = {
        after.lineno
        for after in body
        if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
    }
    for node in body:
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value and _numbers(node.value):
            first, last = node.lineno, node.end_lineno or node.lineno
            while first > 1 and lines[first - 2].strip():
                first -= 1
            told = any("# " in line for line in lines[first - 1 : last])
            while last < len(lines) and lines[last].strip() and last + 1 not in texts:
                last += 1
            if not told and last + 1 not in texts:
                yield lines[node.lineno - 1].strip()


def _numbers(value: ast.expr) -> list[ast.Constant]:
    """All numbers of an expression but 0 and 1, which mean none and one."""
    return [
        each
        for each in ast.walk(value)
        if isinstance(each, ast.Constant)
        and isinstance(each.value, int | float)
        and each.value not in (0, 1)  # True and False too
    ]


def test_every_constant_has_its_reason() -> None:
    files = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
    found = {str(p.relative_to(ROOT)): list(without_reason(p.read_text())) for p in sorted(files)}
    assert {name: rows for name, rows in found.items() if rows} == {}


def test_a_constant_is_told_by_a_comment_or_a_text_alone() -> None:
    source = "A = 3\n\nB = 4  # of two cores each\n\n# why\nC = 5\nD = 6\n\nE = 7\n"
    assert list(without_reason(source)) == ["A = 3", "E = 7"]
    assert list(without_reason('A = 3\nB = 4\n"""Why they are so."""\n\nC = 5\n')) == ["C = 5"]
    assert list(without_reason("A = 1\nB = 0.0\nC = True\nD: int = 2\n")) == ["D: int = 2"]
