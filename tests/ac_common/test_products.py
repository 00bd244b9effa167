"""The compiled product of a matrix and a vector against numpy's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ac_common.products import add_columns, columns_of, multiply


@given(rows=st.integers(0, 40), columns=st.integers(1, 40), seed=st.integers(0, 1000))
def test_it_is_the_product(rows: int, columns: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    matrix, x, out = random.standard_normal((rows, columns)), random.standard_normal(columns), np.full(rows, np.nan)
    multiply(columns_of(matrix), x, out)
    assert out == pytest.approx(matrix @ x, rel=1e-12, abs=1e-12)
    by_numpy = np.full(rows, np.nan)
    add_columns(columns_of(matrix), x, by_numpy)
    np.testing.assert_array_equal(by_numpy, out)
