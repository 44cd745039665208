"""A map and a body for the two cameras of ``tiny_bag``, for tests of the nodes' plumbing."""

from pathlib import Path

import numpy as np

from bodycam_ros.registration.reference_map import ReferenceMap

BODY = """\
name: two_cameras
root: torso
segments: [torso, arm]
joints:
  shoulder: {parent: torso, child: arm, type: ball, origin_in_parent: [0.0, 0.2, 0.4]}
cameras:
  left: {segment: torso, position: [0.1, 0.0, 0.3], quaternion_xyzw: [-0.5, 0.5, -0.5, 0.5]}
  right: {segment: arm, position: [0.05, 0.0, -0.2], quaternion_xyzw: [-0.5, 0.5, -0.5, 0.5]}
"""


def write_body(path: Path, *more_cameras: str) -> Path:
    """The body's file; further cameras sit where ``left`` does."""
    mount = BODY.splitlines()[-2].split(":", 1)[1]
    path.write_text(BODY + "".join(f"  {camera}:{mount}\n" for camera in more_cameras))
    return path


def write_map(path: Path, landmarks: int = 30, seed: int = 5) -> Path:
    """A map of landmarks at random."""
    random = np.random.default_rng(seed)
    view = random.normal(size=(landmarks, 3))
    ReferenceMap(
        landmark_ids=np.arange(1, landmarks + 1, dtype=np.uint32),
        points_world=random.uniform(-3.0, 3.0, (landmarks, 3)),
        colours=random.integers(0, 256, (landmarks, 3), dtype=np.uint8),
        descriptor_landmark=np.arange(landmarks, dtype=np.uint32),
        descriptors=random.integers(0, 80, (landmarks, 128), dtype=np.uint8),
        descriptor_view=(view / np.linalg.norm(view, axis=1, keepdims=True)).astype(np.float32),
        descriptor_size=np.full(landmarks, 0.02, np.float32),
        world_T_camera=np.eye(4)[None],
        image_names=("photograph.jpg",),
        metric=True,
        gravity_aligned=True,
    ).save(path)
    return path
