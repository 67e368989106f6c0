"""No test asserts on a duration: a busy machine would fail it. Benchmarks measure durations."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
DURATIONS = {"perf_counter", "process_time", "thread_time", "perf_counter_ns", "process_time_ns"}
GENEROUS_S = 60  # what waits this long for an event says that it never comes


def find_wall_clocks(tree: ast.AST) -> Iterator[int]:
    """Yield the lines that measure a duration, or assert that one is short."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute | ast.Name):
            name = node.attr if isinstance(node, ast.Attribute) else node.id
            if name in DURATIONS:
                yield node.lineno
        if isinstance(node, ast.Assert):
            yield from (node.lineno for each in ast.walk(node.test) if is_short(each))


def is_short(node: ast.AST) -> bool:
    """Return True for a comparison that asks for less time than an event may take."""
    if not isinstance(node, ast.Compare) or not isinstance(node.ops[0], ast.Lt | ast.LtE):
        return False
    clocks = {e.attr for e in ast.walk(node.left) if isinstance(e, ast.Attribute)}
    limit = node.comparators[0]
    is_difference = isinstance(node.left, ast.BinOp) and isinstance(node.left.op, ast.Sub)
    return (
        is_difference
        and bool({"monotonic", "time"} & clocks)
        and isinstance(limit, ast.Constant)
        and isinstance(limit.value, int | float)
        and limit.value < GENEROUS_S
    )


def test_no_test_asserts_on_wall_clocks() -> None:
    found = {}
    for path in sorted(TESTS.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        if "benchmarks" in path.parts or path == Path(__file__):
            continue
        if any(name in text for name in (*DURATIONS, "monotonic", "time.time")):
            lines = sorted(set(find_wall_clocks(ast.parse(text))))
            found |= {str(path.relative_to(TESTS)): lines} if lines else {}
    assert found == {}
