"""What documents for the browser are made of: plain values, and the colours of the reports.

`static/charts.js` turns the colours for a dark screen.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from datetime import datetime
from enum import Enum
from typing import Any

import numpy as np
from fastapi.responses import JSONResponse

from shm.report.figures.style import PALETTE


def answer(document: dict[str, Any], status: int = 200) -> JSONResponse:
    """A figure over HTTP, without asking what each of its numbers is a second time."""
    return JSONResponse(document, status)


def colour(name: str, opacity: float = 1.0) -> str:
    """A colour of the palette (`blue`, `orange`, ..., `ink`), as plotly takes it."""
    code = PALETTE[name]
    if opacity >= 1:
        return code
    red, green, blue = (int(code[at : at + 2], 16) for at in (1, 3, 5))
    return f"rgba({red},{green},{blue},{opacity:g})"


def plain(value: Any) -> Any:
    """What JSON can say: arrays as lists, times in ISO 8601, NaN and infinity as null."""
    if isinstance(value, Mapping):
        return {str(key): plain(each) for key, each in value.items()}
    if isinstance(value, np.ndarray):
        if value.dtype.kind == "f" and not np.isfinite(value).all():
            return np.where(np.isfinite(value), value, None).tolist()  # type: ignore[call-overload]
        if value.dtype.kind == "M":
            return value.astype(str).tolist()
        return plain(value.tolist()) if value.dtype.kind == "O" else value.tolist()
    if isinstance(value, str | bool) or value is None:
        return value.value if isinstance(value, Enum) else value
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    return _single(value)


def _single(value: Any) -> Any:
    if isinstance(value, datetime):
        return value.isoformat()
    if isinstance(value, np.datetime64):
        return str(value)
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
