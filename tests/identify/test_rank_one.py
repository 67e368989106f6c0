from __future__ import annotations

import numpy as np
import pytest

from shm.identify.setup_merging.products import factors, hang_together
from shm.values import BoolArray

RNG = np.random.default_rng(2)
ROW, COLUMN = RNG.normal(size=(6, 3)), RNG.normal(size=(6, 5))
PRODUCTS = ROW[:, :, np.newaxis] * COLUMN[:, np.newaxis, :]


def _known(*rows: str) -> BoolArray:
    return np.array([[mark == "x" for mark in row] for row in rows])


WHOLE = _known("xxxxx", "xxxxx", "xxxxx")
CHAIN = _known("xxx..", "..xx.", "...xx")
APART = _known("xx...", "xx...", "..xxx")


@pytest.mark.parametrize("known", [WHOLE, CHAIN])
def test_all_products_follow_from_the_known_ones(known: BoolArray) -> None:
    row, column = factors(np.where(known, PRODUCTS, np.nan), known)
    np.testing.assert_allclose(
        row[:, :, np.newaxis] * column[:, np.newaxis, :], PRODUCTS, rtol=1e-4
    )
    np.testing.assert_allclose(np.linalg.norm(column, axis=1), 1.0)


def test_noise_is_averaged_over_the_rows() -> None:
    noisy = PRODUCTS + 1e-3 * RNG.normal(size=PRODUCTS.shape)
    _, column = factors(noisy, WHOLE)
    for found, planted in zip(column, COLUMN, strict=True):
        likeness = (found @ planted) ** 2 / (planted @ planted)
        assert likeness > 0.9999


def test_a_mode_that_one_row_does_not_see_is_told_by_the_others() -> None:
    products = PRODUCTS.copy()
    products[:, 0] = 0.0
    row, column = factors(products, WHOLE)
    assert np.all(row[:, 0] == 0)
    np.testing.assert_allclose(row[:, 1:, np.newaxis] * column[:, np.newaxis], products[:, 1:])


def test_entries_hang_together_where_rows_share_columns() -> None:
    assert hang_together(WHOLE)
    assert hang_together(CHAIN)
    assert not hang_together(APART)
