"""What joint states have of joints that no camera observes."""

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import BodyOutput
from bodycam_ros.errors import SettingsError
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.joint_angles import JointAngles

PREDICT, HOLD, OMIT = CHOICES = ("predict", "hold", "omit")


class UnobservedJoints:
    """Joint states whose reader can tell which joints are observed.

    Args:
        choice: "predict": angles and velocities as they are estimated; "hold": the angles that were observed last, with
            a velocity of NaN; "omit": observed joints alone.

    Raises:
        SettingsError: there is no such choice.
    """

    def __init__(self, choice: str) -> None:
        if choice not in CHOICES:
            raise SettingsError(
                f"the parameter 'unobserved_joints' must be one of {', '.join(CHOICES)}, not '{choice}'"
            )
        self._choice = choice
        self._names: tuple[str, ...] = ()
        self._held = np.zeros(0)

    def joint_states(self, output: BodyOutput, body: BodyModel) -> tuple[tuple[str, ...], Array, Array]:
        """Names, angles [rad] and velocities [rad/s] of the joints of a state."""
        names, positions, velocities = output.joint_names, output.positions, output.velocities
        if self._choice == PREDICT:
            return names, positions, velocities
        observed = output.state.observed[body.joint_ends].all(axis=1)[JointAngles(body).joint_rows]
        if self._choice == OMIT:
            kept = tuple(name for name, is_kept in zip(names, observed, strict=True) if is_kept)
            return kept, positions[observed], velocities[observed]
        if names != self._names:
            self._names, self._held = names, positions
        self._held = np.where(observed, positions, self._held)
        return names, self._held, np.where(observed, velocities, np.nan)
