import numpy as np
import pytest
import yaml
from helpers.naming import naming

from bodycam_ros.boards.board import read_board
from bodycam_ros.errors import MapError

CORNERS = {0: [[-0.1, 0.1, 0], [0.1, 0.1, 0], [0.1, -0.1, 0], [-0.1, -0.1, 0]]}


def write(path, **changes):
    document = {"family": "36h11", "placement": "lying: board z is up", "corners_in_board": CORNERS} | changes
    path.write_text(yaml.safe_dump({k: v for k, v in document.items() if v is not None}))
    return path


@pytest.mark.parametrize(
    ("placement", "up"), [("lying: board z is up", [0, 0, 1]), ("standing: board y is up", [0, 1, 0])]
)
def test_the_upward_axis_turns_to_z(tmp_path, placement, up):
    R = read_board(write(tmp_path / "b.yaml", placement=placement)).map_R_board
    assert np.allclose(R @ up, [0, 0, 1])
    assert np.allclose(R @ R.T, np.eye(3)) and np.linalg.det(R) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"family": None}, ("family",)),
        ({"family": "49h3"}, ("49h3",)),
        ({"corners_in_board": {0: [[0, 0, 0]]}}, ()),
        ({"corners_in_board": {0: [[float("nan"), 0, 0]] * 4}}, ()),
        ({"corners_in_board": {0: [[1e300, 0.1, 0], *CORNERS[0][1:]]}}, ("tag 0",)),
        ({"corners_in_board": {0: [[0.1, 0.1, 0], [-0.1, 0.1, 0], *CORNERS[0][2:]]}}, ("tag 0",)),
        ({"corners_in_board": {"left": CORNERS[0]}}, ()),
    ],
)
def test_a_bad_description_is_an_error_that_names_the_file(tmp_path, changes, named):
    with naming(MapError, "b.yaml", *named):
        read_board(write(tmp_path / "b.yaml", **changes))
