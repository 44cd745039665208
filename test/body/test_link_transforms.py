"""The frames of a URDF's links: Pinocchio finds them in the same places."""

import numpy as np
from helpers.stock_consumer import StockConsumer

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.urdf import LinkTransforms, urdf_text
from bodycam_ros.kinematics.joint_angles import JointAngles


class _Said:
    """The fields of a sensor_msgs/JointState that the consumer reads."""

    def __init__(self, name: tuple[str, ...], position: np.ndarray) -> None:
        self.name, self.position = name, position


def test_links_are_where_pinocchio_has_them(body: BodyModel) -> None:
    text, names = urdf_text(body), JointAngles(body).names
    links, angles = LinkTransforms(body), np.random.default_rng(8).uniform(-6.0, 6.0, len(names))
    # In any order, and of others as well, as joint states may be.
    order = np.random.default_rng(9).permutation(len(names))
    said = links.moving([*(names[row] for row in order), "antenna"], np.append(angles[order], 1.0))
    expected = StockConsumer(text).links(_Said(names, angles))
    root_T_link = {body.root: np.eye(4)}
    waiting = [*said, *links.fixed]
    while waiting:
        parent, child, pose = waiting.pop(0)
        if parent in root_T_link:
            root_T_link[child] = root_T_link[parent] @ pose
        else:
            waiting.append((parent, child, pose))
    assert root_T_link.keys() == expected.keys()
    for link, pose in expected.items():
        np.testing.assert_allclose(root_T_link[link], pose, atol=1e-9)
