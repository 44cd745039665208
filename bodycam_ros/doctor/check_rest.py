"""Whether a range of motion begins with standing still, which is the body's zero."""

from collections.abc import Collection, Iterator

import numpy as np

from bodycam_ros.calibration.rest_pose import RestPoseSettings
from bodycam_ros.doctor.finding import Finding, Light
from bodycam_ros.doctor.registered_samples import RegisteredSamples
from bodycam_ros.geometry import inverse, log_so3

_CHECK = "N-pose"
OPENING_S = (0.1, 0.7, 1.3)
"""Instants at which the person should stand still."""


def check_rest(registered: RegisteredSamples, worn: Collection[str], settings: RestPoseSettings) -> Iterator[Finding]:
    """Compare where the worn cameras are in the first second.

    Args:
        registered: the images of ``OPENING_S`` among others.
        worn: cameras of the rig.
        settings: what counts as standing still.
    """
    opening = np.flatnonzero(registered.instants_s <= OPENING_S[-1] + 1e-6).tolist()
    known = {camera: [p for n, p in registered.known(camera).items() if n in opening] for camera in worn}
    told = {camera: poses for camera, poses in known.items() if len(poses) > 1}
    if not told:
        what = "no camera is registered in the first second"
        yield Finding(_CHECK, Light.RED, what, "stand where the cameras see the mapped place, then begin")
        return
    for camera, poses in sorted(told.items()):
        moved = inverse(poses[0]) @ np.array(poses[1:])
        turn = float(np.linalg.norm(log_so3(moved[:, :3, :3]), axis=1).max())
        shift = float(np.linalg.norm(moved[:, :3, 3], axis=1).max())
        if turn > settings.max_turn or shift > settings.max_shift:
            what = f"moves by {1e3 * shift:.0f} mm and {np.degrees(turn):.0f} deg in the first {OPENING_S[-1]:g} s"
            remedy = "stand still in the N-pose, arms down, for 1.5 s, then begin"
            yield Finding(_CHECK, Light.RED, what, remedy, f"camera {camera}")
    yield Finding(_CHECK, Light.GREEN, f"{len(told)} cameras seen in the first {OPENING_S[-1]:g} s")
