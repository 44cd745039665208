"""MOT: joint angles over time as OpenSim has motions, with the model that they move beside it.

Angles are in degrees, places in metres; ``osim`` says which are which. Time begins at the first instant. A gap is
crossed straight.
"""

import numpy as np

from bodycam_ros.formats.axes import OPENSIM_R_OURS, turned
from bodycam_ros.formats.markers import markers_on
from bodycam_ros.formats.options import MotionOptions
from bodycam_ros.formats.osim import ROOT_ORDER, ROOT_PLACES, ROOT_TURNS, osim
from bodycam_ros.formats.sampled_motion import SampledMotion
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.joint_angles import EulerOrder

MARK = "inDegrees=yes"
OSIM_SUFFIX = ".osim"


def mot(motion: SampledMotion, options: MotionOptions) -> dict[str, str]:
    """The motion as a MOT file, and its model."""
    root = motion.body.root
    of_people = {name for j in motion.body.tree_joints if j.child in motion.people for name in j.angle_names}
    columns = [column for column, name in enumerate(motion.angle_names) if name in of_people]
    names = [f"{root}_{name}" for name in (*ROOT_TURNS, *ROOT_PLACES)]
    numbers = np.column_stack(
        [
            motion.seconds,
            np.degrees(_root_turns(motion)),
            motion.world_T_root[:, :3, 3] @ OPENSIM_R_OURS.T,
            np.degrees(motion.angles[:, columns]),
        ]
    )
    header = [
        motion.name,
        "version=1",
        f"nRows={len(numbers)}",
        f"nColumns={numbers.shape[1]}",
        MARK,
        "endheader",
        "\t".join(["time", *names, *(motion.angle_names[column] for column in columns)]),
    ]
    rows = ["\t".join(map("{:.8f}".format, row)) for row in numbers.tolist()]
    return {
        "": "\n".join([*header, *rows]) + "\n",
        OSIM_SUFFIX: osim(motion.body, motion.people, markers_on(motion)),
    }


def _root_turns(motion: SampledMotion) -> Array:
    """(T, 3) continuous angles of the root, in the order of ``ROOT_ORDER`` [rad]."""
    order, previous = EulerOrder((ROOT_ORDER,)), np.zeros((1, 3))
    angles = np.empty((len(motion.stamps_ns), 3))
    for row, turn in enumerate(turned(OPENSIM_R_OURS, motion.world_T_root[:, :3, :3])):
        previous = order.decompose(turn[None], previous)
        angles[row] = previous[0]
    return angles
