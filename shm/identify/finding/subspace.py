"""The one door to pyOMA2: two functions of its `ssi` module, kept quiet.

Importing pyOMA2 turns numpy's warnings off, attaches a log handler, mutes matplotlib's logger and
draws progress bars on standard error; all four are undone here. Only `pyoma2.functions.ssi` is
imported: the rest of the package brings pandas and scikit-learn.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from typing import Any

import numpy as np

from shm.values import FloatArray

_MATPLOTLIB_LEVEL = logging.getLogger("matplotlib").level
with np.errstate():
    from pyoma2.functions import ssi


def _no_progress_bar(*bounds: int, **_: Any) -> Iterator[int]:
    return iter(range(*bounds))


def _silence() -> None:
    logger = logging.getLogger("pyoma2")
    for handler in list(logger.handlers):
        logger.removeHandler(handler)
    logger.setLevel(logging.WARNING)
    logging.getLogger("matplotlib").setLevel(_MATPLOTLIB_LEVEL)
    setattr(ssi, "trange", _no_progress_bar)  # noqa: B010


_silence()


def hankel(response: FloatArray, reference: FloatArray, block_rows: int) -> FloatArray:
    """Sum over time of future responses times past references.

    `response` (channels, samples) and `reference` (references, samples) give a matrix of shape
    (channels * block_rows, references * block_rows). For a free decay it is exact, and it leaves
    out lag zero, hence white noise.
    """
    matrix, _ = ssi.build_hank(response, reference, block_rows, "cov")
    return np.asarray(matrix * response.shape[1], dtype=np.float64)


def hankel_with_input(
    response: FloatArray, reference: FloatArray, force: FloatArray, block_rows: int
) -> FloatArray:
    """The same after what the future of `force` (1, samples) explains is projected out.

    Its least squares are scaled by the force's own size; as future responses and past references
    enter both with the share of a direction that the force has, weak ones do no harm.
    """
    matrix, _ = ssi.build_hank(response, reference, block_rows, "IOcov", U=force)
    return np.asarray(matrix * response.shape[1], dtype=np.float64)


def realise(
    matrix: FloatArray, block_rows: int, max_order: int
) -> tuple[FloatArray, list[FloatArray], list[FloatArray]]:
    """Observability matrix (rows, max_order); state and output matrices of orders 0, 2, 4, ..."""
    observability, states, outputs, _ = ssi.SSI_fast(matrix, block_rows, max_order, step=2)
    return np.asarray(observability, dtype=np.float64), list(states), list(outputs)
