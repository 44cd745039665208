"""What a camera knows at an instant of where it is."""

from enum import IntEnum

from bodycam_ros.registration.landmark_matches import LandmarkMatches


class CameraSight(IntEnum):
    """From the most to the least; of several images the worst is the greatest."""

    REGISTERED = 0
    """In the reference map (A 4.1): nothing drifts."""
    RELATIVE = 1
    """By landmarks of which most are grown from the cameras' own tracks, so that it is as good as those are."""
    ROTATION_ONLY = 2
    """No pose, but it follows how it turns (A eq. 2)."""
    BLIND = 3
    """Nothing: a black, blurred or bare picture."""

    @property
    def label(self) -> str:
        """For people."""
        return self.name.lower().replace("_", " ")


def camera_sight(matches: LandmarkMatches) -> CameraSight:
    """What a camera knows by what its registrar says of an image."""
    if matches.world_T_camera is not None:
        grown_prevail = 2 * matches.grown > len(matches.landmark_ids)
        return CameraSight.RELATIVE if grown_prevail else CameraSight.REGISTERED
    return CameraSight.ROTATION_ONLY if matches.rotation_inliers else CameraSight.BLIND
