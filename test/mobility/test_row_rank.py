import numpy as np

from bodycam_ros.mobility.row_rank import dependent_rows, null_space, rank, unit_rows


def test_rank_does_not_depend_on_the_units_of_rows_and_rounding_is_no_row() -> None:
    random = np.random.default_rng(1)
    rows = random.normal(size=(3, 6))
    rows = np.vstack([rows, rows[0] + 2.0 * rows[2], 1e-14 * random.normal(size=6)])
    scaled = rows * np.array([[1e-3], [1.0], [1e4], [1e2], [1.0]])
    unit = unit_rows(scaled)
    assert rank(unit) == rank(unit_rows(rows)) == 3
    assert null_space(unit).shape == (6, 3)
    np.testing.assert_allclose(rows[:4] @ null_space(unit), 0.0, atol=1e-12)


def test_a_dependent_row_is_told_with_those_that_say_it() -> None:
    random = np.random.default_rng(2)
    rows = random.normal(size=(3, 5))
    unit = unit_rows(np.vstack([rows[:2], rows[0] - rows[1], rows[2], 3.0 * rows[1], np.zeros(5)]))
    assert [(found.row, found.said_by) for found in dependent_rows(unit)] == [(2, (0, 1)), (4, (1,)), (5, ())]


def test_no_rows_leave_everything_free() -> None:
    none = np.zeros((0, 4))
    assert rank(none) == 0
    np.testing.assert_array_equal(null_space(none), np.eye(4))
