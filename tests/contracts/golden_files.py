"""What the contracts share: golden files in few lines, and signatures as they were."""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any


def shorten(value: Any) -> Any:
    """Return a document with its numbers to six digits."""
    if isinstance(value, dict):
        return {key: shorten(each) for key, each in value.items()}
    if isinstance(value, list):
        return [shorten(each) for each in value]
    return float(f"{value:.6g}") if isinstance(value, float) else value


def compress(text: str) -> str:
    """Return a document in few lines: one for each part of its first level."""
    document = json.loads(text)
    parts = [f"{json.dumps(key)}: {json.dumps(value)}" for key, value in document.items()]
    return "{\n" + ",\n".join(parts) + "\n}\n"


def write_missing(files: Mapping[Path, Callable[[], str]]) -> None:
    """Write each golden file that is not there; the others stay as they are."""
    for path, make in files.items():
        if not path.exists():
            path.parent.mkdir(exist_ok=True)
            path.write_text(make(), encoding="utf-8")
            print(f"{path.name}: {path.stat().st_size / 1000:.1f} kB", flush=True)


def assert_signature(found: Callable[..., Any], expected: str) -> None:
    """Compare names, order and defaults of parameters; more may follow, each with a default."""
    parameters = [_bare(each) for each in inspect.signature(found).parameters.values()]
    count = len(re.sub(r"\*, ", "", expected).split(", "))
    assert str(inspect.Signature(parameters[:count])) == f"({expected})"
    assert inspect.Parameter.empty not in [each.default for each in parameters[count:]]


def _bare(parameter: inspect.Parameter) -> inspect.Parameter:
    """Return a parameter without its type; a default that is a function becomes its name."""

    class Named:
        def __repr__(self) -> str:
            return str(parameter.default.__name__)

    default = Named() if inspect.isfunction(parameter.default) else parameter.default
    return parameter.replace(annotation=inspect.Parameter.empty, default=default)
