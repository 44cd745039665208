"""What of a body's shape static cameras tell: where joints are on their segments, and how thick segments are.

Unknown are shares of what the body that is begun with has: of each coordinate of a joint in its parent, and of the
girth of each segment.
"""

from dataclasses import replace
from functools import cached_property

import numpy as np

from bodycam_ros.body.body_model import THICKEST, THINNEST, BodyModel
from bodycam_ros.body.segment_shape import BONE_RADIUS_M
from bodycam_ros.calibration.anatomy import mirrored
from bodycam_ros.geometry import Array
from bodycam_ros.outside import girths
from bodycam_ros.outside.capsules import capsule_surfaces
from bodycam_ros.outside.shape_settings import ShapeSettings

_SHORTEST = -0.9  # share: a length or girth keeps its sign


class BodyShape:
    """The unknown shares of a body's lengths, then of its girths; 0 as they were.

    Args:
        body: that is begun with; alone, without equipment.
        settings: how far it may be off.

    Attributes:
        lengths: (joint, axis) of each unknown length, a coordinate of the joint in its parent.
        thick: segment of each unknown girth.
        size: K, of both.
    """

    def __init__(self, body: BodyModel, settings: ShapeSettings) -> None:
        self._body, self._settings = body, settings
        self._stature = girths.stature_of(body)
        self.lengths = [
            (joint, axis)
            for joint in body.tree_joints
            for axis in range(3)
            if abs(joint.parent_T_joint[axis, 3]) > BONE_RADIUS_M
        ]
        self.thick = list(capsule_surfaces(body))
        self.size = len(self.lengths) + len(self.thick)

    def shaped(self, shares: Array) -> BodyModel:
        """The body with other lengths and girths, by shares (K,) of those that it had."""
        places = {joint.name: joint.parent_T_joint.copy() for joint, _ in self.lengths}
        for (joint, axis), share in zip(self.lengths, shares, strict=False):
            places[joint.name][axis, 3] *= 1.0 + max(float(share), _SHORTEST)
        joints = [
            replace(joint, parent_T_joint=places.get(joint.name, joint.parent_T_joint)) for joint in self._body.joints
        ]
        body = replace(self._body, joints=tuple(joints))
        # Girths are said in those of people of the body's size, and its size may have changed.
        size = self._stature / girths.stature_of(body)
        thick = {
            segment: float(np.clip(size * self._girth(segment) * (1.0 + share), THINNEST, THICKEST))
            for segment, share in zip(self.thick, shares[len(self.lengths) :], strict=True)
        }
        return replace(body, girths=thick)

    def prior(self, shares: Array) -> tuple[Array, Array]:
        """What is expected beforehand, as normal equations (K, K), (K,) about shares (K,); left is as right."""
        of, count = self._settings, len(self.lengths)
        sigmas = np.repeat([of.length_sigma, of.girth_sigma], [count, len(self.thick)])
        sizes = np.array(
            [abs(joint.parent_T_joint[axis, 3]) for joint, axis in self.lengths] + [*map(self._girth, self.thick)]
        )
        J, residuals = [np.diag(1.0 / sigmas)], [shares / sigmas]
        for pair in self._pairs:
            sigma = of.asymmetry_sigma if pair[0] < count else of.girth_asymmetry_sigma
            row = np.zeros((1, self.size))
            row[0, pair] = sizes[pair] * [1.0, -1.0] / (sizes[pair].mean() * sigma)
            J.append(row)
            residuals.append(row @ (1.0 + shares))
        rows, off = np.concatenate(J), np.concatenate(residuals)
        return rows.T @ rows, -rows.T @ off

    @cached_property
    def _pairs(self) -> list[list[int]]:
        """Rows of what is on one side, and of the same on the other."""
        names = [(joint.name, axis) for joint, axis in self.lengths] + [(segment, -1) for segment in self.thick]
        row = {name: number for number, name in enumerate(names)}
        opposite = [row.get((mirrored(name) or "", axis), -1) for name, axis in names]
        return [[own, other] for own, other in enumerate(opposite) if other > own]

    def _girth(self, segment: str) -> float:
        return self._body.girths.get(segment, 1.0)
