"""Of many cases alike, some run with every `make test` and all with `make bench`."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest


def few_of(cases: Iterable[object], quick: int) -> list[object]:
    """All cases for `parametrize`: so many, spread from first to last, as ever, the others slow."""
    cases = list(cases)
    chosen = set(np.linspace(0, len(cases) - 1, quick).astype(int))
    return [
        each
        if number in chosen
        else pytest.param(*(each if isinstance(each, tuple) else (each,)), marks=pytest.mark.slow)
        for number, each in enumerate(cases)
    ]
