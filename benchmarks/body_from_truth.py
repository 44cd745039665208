"""Make a body file from a recording's ground truth: a yardstick for the solver, and the body until it is estimated.

    python -m benchmarks.body_from_truth RECORDING -o body.yaml

Keeps the segments that carry a camera or lie between the root and one that does. Ground truth serves scoring and
tests only; the product never reads it.
"""

import argparse
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from bodycam_ros.body.body_file import write_body
from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.kinematics.joint import Joint

LONG_AXIS_X = "yxz"  # a foot lies along x in the N-pose
LYING_SEGMENTS = ("foot_left", "foot_right")


def body_from_truth(recording: Path) -> BodyModel:
    """The body of a recording with ``rig.yaml``, ``truth/skeleton.yaml`` and ``truth/mounts.yaml``."""
    rig = yaml.safe_load((recording / "rig.yaml").read_text())
    skeleton = yaml.safe_load((recording / "truth" / "skeleton.yaml").read_text())
    mounts = yaml.safe_load((recording / "truth" / "mounts.yaml").read_text())
    parents = {joint["child"]: joint["parent"] for joint in skeleton.values()}
    kept = _segments_towards_cameras(parents, {mount["segment"] for mount in mounts.values()})
    segments = [segment for segment in rig["segments"] if segment in kept]
    return BodyModel(
        name=recording.resolve().name,
        root=next(segment for segment in segments if segment not in parents),
        segments=tuple(segments),
        joints=tuple(_joint(name, joint) for name, joint in skeleton.items() if joint["child"] in kept),
        mounts={
            name: CameraMount(mount["segment"], np.array(mount["T_segment_camera"])) for name, mount in mounts.items()
        },
        report={"source": "ground truth of the recording"},
    )


def _joint(name: str, joint: dict[str, Any]) -> Joint:
    parent_T_joint = np.eye(4)
    parent_T_joint[:3, 3] = joint["offset_in_parent"]
    lying = joint["child"] in LYING_SEGMENTS
    options: dict[str, Any] = {"angle_axes": LONG_AXIS_X} if lying else {}
    return Joint(name, joint["parent"], joint["child"], "ball", parent_T_joint, **options)


def _segments_towards_cameras(parents: dict[str, str], with_camera: set[str]) -> set[str]:
    kept = set(with_camera)
    for segment in with_camera:
        while segment in parents:
            segment = parents[segment]
            kept.add(segment)
    return kept


def main() -> None:
    """Read the recording, write the body."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path, help="folder with rig.yaml and truth/")
    parser.add_argument("-o", "--output", type=Path, required=True, help="body file to write")
    arguments = parser.parse_args()
    body = body_from_truth(arguments.recording)
    write_body(body, arguments.output)
    print(f"{arguments.output}: {len(body.segments)} segments, {len(body.joints)} joints, {len(body.mounts)} cameras")


if __name__ == "__main__":
    main()
