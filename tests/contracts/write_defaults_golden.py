"""Write the golden file of defaults: assumptions, settings, options and thresholds by name.

    python tests/contracts/write_defaults_golden.py

Write it again when a default is meant to change, with a line in CHANGELOG.md.
"""

from __future__ import annotations

import json
import math
import sys
from dataclasses import MISSING, asdict, fields
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from shm.acquire.guide import AcquireOptions  # noqa: E402
from shm.assumptions import DEFAULTS  # noqa: E402
from shm.gap.bridge.shared_evidence import SharingOptions  # noqa: E402
from shm.gap.check import CheckOptions  # noqa: E402
from shm.gap.hypotheses.contract import GapOptions  # noqa: E402
from shm.gap.hypotheses.sampling import SamplingOptions  # noqa: E402
from shm.identify.options import IdentifyOptions  # noqa: E402
from shm.inference.options import UpdateOptions  # noqa: E402
from shm.inference.problem.data_checks import CheckLimits  # noqa: E402
from shm.inference.problem.shapes import ShapeOptions  # noqa: E402
from shm.settings import TABLE  # noqa: E402
from shm.values.hanger import Thresholds  # noqa: E402
from shm.watch.engine.options import WatchOptions  # noqa: E402
from shm.watch.engine.state import StateOptions  # noqa: E402
from shm.watch.neighbours import NeighbourOptions  # noqa: E402
from shm.watch.sensors.stream_watch import StreamOptions  # noqa: E402

GOLDEN = Path(__file__).parent / "golden" / "defaults.json"
OPTIONS = (
    AcquireOptions, CheckLimits, CheckOptions, GapOptions, IdentifyOptions, NeighbourOptions,
    SamplingOptions, ShapeOptions, SharingOptions, StateOptions, StreamOptions, Thresholds,
    UpdateOptions, WatchOptions,
)  # fmt: skip
_WORDS = ("name", "unit", "source", "reason", "origin")


def list_defaults() -> dict[str, Any]:
    """Return each default by name: `assumptions.modulus_sd.value`, `settings.samples`."""
    found: dict[str, Any] = {}
    for row in DEFAULTS.values():
        for key, number in asdict(row).items():
            if key not in _WORDS:
                found[f"assumptions.{row.name}.{key}"] = number
    for setting in TABLE:
        for key in ("default", "low", "high"):
            found[f"settings.{setting.name}.{key}"] = getattr(setting, key)
    for kind in OPTIONS:
        for each in fields(kind):
            found[f"{kind.__name__}.{each.name}"] = each.default
    return {name: _plain(value) for name, value in found.items() if _is_stated(value)}


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def _is_stated(value: Any) -> bool:
    if isinstance(value, float):
        return math.isfinite(value)
    return value is not None and value is not MISSING


if __name__ == "__main__":
    GOLDEN.write_text(json.dumps(list_defaults(), indent=1) + "\n", encoding="utf-8")
