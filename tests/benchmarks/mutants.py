"""Random mutants of the product: would the tests notice if one line said something else?

    python tests/benchmarks/mutants.py --seed 3 --mutants 100
    python tests/benchmarks/mutants.py --mutants 60 --rooms shm/gap shm/watch shm/store shm/report

A line is drawn among all lines of the product that can be changed, then one change of it: a
comparison turned, + and - swapped, * and / swapped, `not` dropped, `and` and `or` swapped, a number
or a flag changed, None returned, a call left out whose value nobody takes. Each is written into a
copy of the working tree and meets at most `--files` files of tests, nearest first: of its name,
then those that import the module, then the rest of its package's folder and its contract. What
none of them notices survived; whether it is equivalent, a person decides. Not changed: docstrings,
texts, `__repr__`, logging, types, flags of a dataclass.
"""

from __future__ import annotations

import argparse
import ast
import copy
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PRODUCT = ("shm", "daemon/shm_daemon", "cli/shm_cli")
# A comparison becomes its contrary or moves by its boundary: each with the same chance.
_TURNED: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.GtE, ast.LtE),
    ast.LtE: (ast.Gt, ast.Lt),
    ast.Gt: (ast.LtE, ast.GtE),
    ast.GtE: (ast.Lt, ast.Gt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
_SWAPPED: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
}
_LOGGING = {"log", "logger", "logging", "_log", "_LOG", "LOG", "_logger", "_LOGGER"}
# Rooms of one file have their tests in folders of another name.
_FOLDERS = {
    "shm_daemon": ("daemon",),
    "shm_cli": ("cli",),
    "values": ("spine", "store", "report", "watch"),
    "export": ("api",),
    "notebook": ("api",),
    "plot": ("api",),
}


def sites(tree: ast.AST) -> list[ast.AST]:
    """The places that can be changed, in the order of the file."""
    found: list[ast.AST] = []

    def walk(node: ast.AST) -> None:
        if _is_left_alone(node):
            return
        if _can_change(node):
            found.append(node)
        if isinstance(node, ast.AnnAssign):
            children = [node.value] if node.value else []
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            defaults = [*node.args.defaults, *node.args.kw_defaults]
            children = [*(d for d in defaults if d), *node.decorator_list, *node.body]
        else:
            children = list(ast.iter_child_nodes(node))
        for child in children:
            walk(child)

    walk(tree)
    return found


def _is_left_alone(node: ast.AST) -> bool:
    match node:
        case ast.JoinedStr() | ast.If(test=ast.Name(id="TYPE_CHECKING")):
            return True
        case ast.FunctionDef(name="__repr__"):
            return True
        case ast.Call(func=ast.Name(id="dataclass")):
            return True
        case ast.Expr(value=ast.Call(func=ast.Attribute(value=ast.Name(id=name)))):
            return name in _LOGGING
    return False


def _can_change(node: ast.AST) -> bool:
    match node:
        case ast.Compare(ops=[_]) | ast.BoolOp() | ast.UnaryOp(op=ast.Not()):
            return True
        case ast.BinOp(left=left, op=op, right=right):
            return type(op) in _SWAPPED and not any(map(_is_text, (left, right)))
        case ast.Constant(value=bool() | int() | float()):
            return True
        case ast.Return(value=value):
            return value is not None and not isinstance(value, ast.Constant)
        case ast.Expr(value=ast.Call()):
            return True
    return False


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.JoinedStr) or (
        isinstance(node, ast.Constant) and isinstance(node.value, str)
    )


def mutated(node: ast.AST, rng: random.Random) -> str:
    """The text that stands in the place of `node`."""
    new = copy.deepcopy(node)
    match new:
        case ast.Return():
            return "return None"
        case ast.Expr():
            return "pass"
        case ast.Constant(value=bool(value)):
            return repr(not value)
        case ast.Constant(value=int(value)):
            return repr(value + 1)
        case ast.Constant(value=float(value)):
            return repr(value * 1.5 if value else 1.0)
        case ast.Compare():
            new.ops = [rng.choice(_TURNED[type(new.ops[0])])()]
        case ast.BinOp():
            new.op = _SWAPPED[type(new.op)]()
        case ast.BoolOp():
            new.op = ast.Or() if isinstance(new.op, ast.And) else ast.And()
        case ast.UnaryOp():
            new = new.operand
    return f"({ast.unparse(new)})"


def changed(source: str, node: ast.AST, text: str) -> str:
    """The source with `text` in the place of `node`; columns of `ast` count bytes."""
    lines = source.encode().splitlines(keepends=True)
    first = sum(map(len, lines[: node.lineno - 1])) + node.col_offset  # type: ignore[attr-defined]
    last = sum(map(len, lines[: node.end_lineno - 1])) + node.end_col_offset  # type: ignore[attr-defined]
    raw = source.encode()
    return (raw[:first] + text.encode() + raw[last:]).decode()


def drawn(
    root: Path, rooms: Sequence[str], seed: str, count: int
) -> list[tuple[Path, int, str, str]]:
    """File, line, what stood there, the changed file. Each line has the same chance."""
    rng = random.Random(seed)
    files = sorted(path for room in rooms for path in (root / room).rglob("*.py"))
    by_line: dict[tuple[Path, int], list[ast.AST]] = {}
    for path in files:
        for node in sites(ast.parse(path.read_text())):
            by_line.setdefault((path, node.lineno), []).append(node)  # type: ignore[attr-defined]
    found = []
    for path, line in rng.sample(sorted(by_line), count):
        node = rng.choice(by_line[path, line])
        source, text = path.read_text(), mutated(node, rng)
        old = ast.get_source_segment(source, node) or ""
        found.append((path, line, old, changed(source, node, text)))
    return found


def nearest(root: Path, path: Path) -> list[Path]:
    """The files of tests, nearest first."""
    parts = path.relative_to(root).with_suffix("").parts
    room = parts[1] if len(parts) > 1 else parts[0]
    folders = _FOLDERS.get(room, (room,))
    contracts = {f"test_{each}_contract" for each in folders}
    module = ".".join(parts[1:] if parts[0] in ("cli", "daemon") else parts)
    ranks = {}
    for test in (root / "tests").rglob("test_*.py"):
        own = test.parent.name in folders or test.stem in contracts
        named = path.stem.strip("_") in test.stem
        imported = module in (text := test.read_text()) or (own and path.stem in text)
        if own or named or imported:
            ranks[test] = (not (named and own), not imported, not own, test.name)
    return sorted(ranks, key=lambda test: ranks[test])


def survives(root: Path, files: list[Path], seconds: float) -> bool | None:
    """Whether all tests pass; None where they took longer than `seconds`."""
    path = os.pathsep.join(str(root / part) for part in (".", "daemon", "cli"))
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
    try:
        done = subprocess.run(
            [*command, *map(str, files)],
            cwd=root,
            env={**os.environ, "PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"},
            capture_output=True,
            timeout=seconds,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return None
    return done.returncode == 0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", default="0")
    parser.add_argument("--mutants", type=int, default=5)
    parser.add_argument("--rooms", nargs="+", default=PRODUCT, help="folders of the product")
    parser.add_argument("--files", type=int, default=12, help="files of tests a mutant meets")
    parser.add_argument("--seconds", type=float, default=180.0, help="then it is undecided")
    asked = parser.parse_args()
    count = {"killed": 0, "survived": 0, "undecided": 0}
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder) / "tree"
        left = shutil.ignore_patterns(".*", "__pycache__", "build")
        shutil.copytree(ROOT, root, ignore=left)
        for path, line, old, source in drawn(root, asked.rooms, asked.seed, asked.mutants):
            before = path.read_text()
            path.write_text(source)
            passed = survives(root, nearest(root, path)[: asked.files], asked.seconds)
            path.write_text(before)
            said = {True: "survived", False: "killed", None: "undecided"}[passed]
            count[said] += 1
            now = source.splitlines()[line - 1].strip()
            print(f"{said}: {path.relative_to(root)}:{line}: {old!r} in: {now}", flush=True)
    print(", ".join(f"{number} {said}" for said, number in count.items()))


if __name__ == "__main__":
    main()
