"""Oracle: the convention as it is written, cell by cell; a plane is a plane however it is sampled."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fdslam.compact.grid import Grid
from fdslam.types import CELL, grid_shape
from tests.reference.compact import centre

SIDE, STEP = st.integers(1, 7), st.floats(2, 40)


@given(SIDE, SIDE, STEP, STEP)
def test_centres_row_by_row_and_back(rows, cols, step_x, step_y):
    grid = Grid(rows, cols, step_x, step_y)
    expected = [centre(grid, row, col) for row in range(rows) for col in range(cols)]
    assert np.allclose(grid.centres(), expected, rtol=1e-6)
    whole = [(col, row) for row in range(rows) for col in range(cols)]
    assert np.allclose(grid.places(np.array(expected)), whole, atol=1e-9)
    assert np.allclose(grid.places(np.zeros((1, 2))), -0.5)


STEPS = st.sampled_from([4.0, 8.0, 9.2, 18.4])


@given(st.integers(40, 130), st.integers(40, 130), STEPS, STEPS)
def test_a_plane_stays_one_on_the_cells(height, width, step_x, step_y):
    grid = Grid(int(height // step_y) + 1, int(width // step_x) + 1, step_x, step_y)
    x, y = grid.centres().T.reshape(2, grid.rows, grid.cols)
    cells = grid.to_cells((0.3 * x - 0.2 * y + 5).astype(np.float32), height, width)
    rows, cols = grid_shape(height, width)
    assert cells.shape == (rows, cols)
    assert cells.dtype == np.float32
    for row in range(rows):
        for col in range(cols):
            at = [(n + 0.5) * CELL for n in (col, row)]
            # Beyond the outermost centres their values go on.
            u, v = (min(max(p, s.min()), s.max()) for p, s in zip(at, (x, y), strict=True))
            assert abs(cells[row, col] - (0.3 * u - 0.2 * v + 5)) < 0.02 * (step_x + step_y)
