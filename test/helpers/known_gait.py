"""A walk of two legs whose every figure is known: feet that stand where they stand, and swing on arcs."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import sole_points
from bodycam_ros.geometry import exp_so3, rigid, transform_points

THIGH_M, SHIN_M, HIPS_M, PELVIS_M = 0.42, 0.42, 0.18, 0.9
RATE_HZ = 60.0

Poses = NDArray[np.float64]


@dataclass(frozen=True)
class KnownGait:
    """What is asked for.

    Attributes:
        stride_s: duration of a stride.
        stride_m: its length.
        stance: side -> share of the stride for which the foot stands.
        lift_m: side -> by which the foot is lifted in the middle of its swing.
        heading_rad: where to.
        strides: of each foot.
    """

    stride_s: float = 1.1
    stride_m: float = 1.3
    stance: tuple[float, float] = (0.6, 0.6)
    lift_m: tuple[float, float] = (0.1, 0.1)
    heading_rad: float = 0.0
    strides: int = 5

    def poses(self) -> tuple[Poses, dict[str, Poses], dict[str, Poses]]:
        """Seconds (T,), segment -> (T, 4, 4) [m], and side -> (T, 2, 3) heel and ball [m]."""
        seconds = np.arange(0.0, self.strides * self.stride_s, 1.0 / RATE_HZ)
        turn = exp_so3(np.array([0.0, 0.0, self.heading_rad]))
        speed = self.stride_m / self.stride_s
        pelvis = np.column_stack([speed * seconds, np.zeros_like(seconds), np.full_like(seconds, PELVIS_M)])
        world = {"pelvis": rigid(turn, pelvis @ turn.T)}
        soles = {}
        for column, (side, offset) in enumerate((("left", 0.0), ("right", 0.5))):
            across = (1.0 if side == "left" else -1.0) * HIPS_M / 2.0
            ankle = self._ankle(seconds, column, offset, across)
            hip = pelvis + [0.0, across, 0.0]
            thigh, shin = _two_bones(hip, ankle)
            for name, origin, R in (("thigh", hip, thigh), ("shin", ankle - shin @ [0, 0, -SHIN_M], shin)):
                world[f"{name}_{side}"] = rigid(turn @ R, origin @ turn.T)
            world[f"foot_{side}"] = rigid(turn, ankle @ turn.T)
            soles[side] = transform_points(world[f"foot_{side}"], sole_points(SHIN_M))
        return seconds, world, soles

    def seen_stance(self, column: int) -> float:
        """Share of a stride from where the heel is furthest ahead of the pelvis to where the ball is furthest behind.

        In its swing a foot is slower than the pelvis at first and at last: as long as 1 - cos(2 pi s) is less than the
        share of the swing.
        """
        swing = 1.0 - self.stance[column]
        return float(1.0 - swing + swing * np.arccos(1.0 - swing) / np.pi)

    def clearance_m(self, column: int) -> float:
        """Lift of the foot a quarter of the seen swing into it."""
        swing = 1.0 - self.stance[column]
        early = float(np.arccos(1.0 - swing)) / (2.0 * np.pi)
        return float(self.lift_m[column] * np.sin(np.pi * (early + 0.25 * (1.0 - 2.0 * early))) ** 2)

    def _ankle(self, seconds: Poses, column: int, offset: float, across: float) -> Poses:
        """A foot stands for a share of its stride, half of it ahead of the pelvis, then swings a stride on."""
        stance = self.stance[column]
        phase = seconds / self.stride_s + offset
        stride, within = np.floor(phase), np.mod(phase, 1.0)
        swing = np.clip((within - stance) / (1.0 - stance), 0.0, 1.0)
        eased = swing - np.sin(2.0 * np.pi * swing) / (2.0 * np.pi)
        ahead = self.stride_m * (stride - offset + stance / 2.0 + eased)
        lifted = self.lift_m[column] * np.sin(np.pi * swing) ** 2
        height = -sole_points(SHIN_M)[0, 2] + lifted
        return np.column_stack([ahead, np.full_like(seconds, across), height])


def _two_bones(hip: Poses, ankle: Poses) -> tuple[Poses, Poses]:
    """Rotations (T, 3, 3) of thigh and shin about y that reach from hips to ankles, the knee ahead."""
    reach = ankle - hip
    length = np.clip(np.linalg.norm(reach, axis=1), 0.05, THIGH_M + SHIN_M - 1e-6)
    leaning = np.arctan2(reach[:, 0], -reach[:, 2])
    at_hip = np.arccos(np.clip((THIGH_M**2 + length**2 - SHIN_M**2) / (2.0 * THIGH_M * length), -1.0, 1.0))
    at_ankle = np.arccos(np.clip((SHIN_M**2 + length**2 - THIGH_M**2) / (2.0 * SHIN_M * length), -1.0, 1.0))
    axis = np.array([0.0, 1.0, 0.0])
    return exp_so3(-(leaning + at_hip)[:, None] * axis), exp_so3(-(leaning - at_ankle)[:, None] * axis)
