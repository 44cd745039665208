"""Unknown lengths and girths of a body that static cameras measure: where joints are, and how thick segments are.

Unknown are shares of what the initial body has: of each coordinate of a joint in its parent, and of the girth of each
segment.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bodycam_ros.body import average_person
from bodycam_ros.body.body_model import BONE_RADIUS_M, THICKEST, THINNEST, BodyModel
from bodycam_ros.body.limb_mesh import capsule_surfaces
from bodycam_ros.body.segment_name import mirrored
from bodycam_ros.geometry import Array
from bodycam_ros.settings import SettingsGroups, setting


@dataclass(frozen=True)
class ShapeSettings:
    """What is expected of a body that static cameras measure."""

    length_sigma: float = setting(
        0.06,
        limits=(0.001, 1.0),
        reason="relative standard deviation of a length before it is measured; raise it for unusual proportions",
    )


@dataclass(frozen=True)
class MeasureSettings(SettingsGroups):
    """Settings of measuring a body by static cameras, beside those of following it."""

    shape: ShapeSettings = ShapeSettings()


_GIRTH_SIGMA = 0.08  # relative; people's girths differ by some 8 %
_ASYMMETRY_SIGMA = 0.01  # share of a length by which left and right differ: 4 mm of a thigh
_GIRTH_ASYMMETRY_SIGMA = 0.03  # the same of girths
_SHORTEST = -0.9  # share: a length or girth keeps its sign


class BodyShape:
    """The unknown shares of a body's lengths, then of its girths; 0 as they were.

    Args:
        body: initial one; alone, without equipment.
        settings: how far it may be off.

    Attributes:
        lengths: (joint, axis) of each unknown length, a coordinate of the joint in its parent.
        thick: segment of each unknown girth.
        size: K, of both.
        initial: (K,) lengths [m] and girths of the body.
        names: (K) joint and axis of each length, segment and empty of each girth.
    """

    def __init__(self, body: BodyModel, settings: ShapeSettings) -> None:
        self._body, self._settings = body, settings
        self._stature = average_person.stature_of(body)
        self.lengths = [
            (joint, axis)
            for joint in body.tree_joints
            for axis in range(3)
            if abs(joint.parent_T_joint[axis, 3]) > BONE_RADIUS_M
        ]
        self.thick = list(capsule_surfaces(body))
        self.size = len(self.lengths) + len(self.thick)
        lengths = [joint.parent_T_joint[axis, 3] for joint, axis in self.lengths]
        self.initial = np.array([*lengths, *(body.girths.get(segment, 1.0) for segment in self.thick)])
        self.names = [(joint.name, "xyz"[axis]) for joint, axis in self.lengths] + [(name, "") for name in self.thick]

    def shaped(self, shares: Array) -> BodyModel:
        """The body with other lengths and girths, by shares (K,) of those that it had."""
        count, values = len(self.lengths), self.initial * (1.0 + np.maximum(shares, _SHORTEST))
        places = {joint.name: joint.parent_T_joint.copy() for joint, _ in self.lengths}
        for (joint, axis), length in zip(self.lengths, values[:count], strict=True):
            places[joint.name][axis, 3] = length
        joints = [
            replace(joint, parent_T_joint=places.get(joint.name, joint.parent_T_joint)) for joint in self._body.joints
        ]
        body = replace(self._body, joints=tuple(joints))
        # Girths are relative to those of people of the body's size, and its size may have changed.
        girths = np.clip(self._stature / average_person.stature_of(body) * values[count:], THINNEST, THICKEST)
        return replace(body, girths=dict(zip(self.thick, girths.tolist(), strict=True)))

    def prior(self, shares: Array) -> tuple[Array, Array]:
        """What is expected beforehand, as normal equations (K, K), (K,) about shares (K,); left is as right."""
        count, sizes = len(self.lengths), np.abs(self.initial)
        sigmas = np.repeat([self._settings.length_sigma, _GIRTH_SIGMA], [count, len(self.thick)])
        J, residuals = [np.diag(1.0 / sigmas)], [shares / sigmas]
        for pair in self._pairs:
            sigma = _ASYMMETRY_SIGMA if pair[0] < count else _GIRTH_ASYMMETRY_SIGMA
            row = np.zeros((1, self.size))
            row[0, pair] = sizes[pair] * [1.0, -1.0] / (sizes[pair].mean() * sigma)
            J.append(row)
            residuals.append(row @ (1.0 + shares))
        rows, off = np.concatenate(J), np.concatenate(residuals)
        return rows.T @ rows, -rows.T @ off

    @cached_property
    def _pairs(self) -> list[list[int]]:
        """Rows of what is on one side, and of the same on the other."""
        row = {name: number for number, name in enumerate(self.names)}
        opposite = [row.get((mirrored(name) or "", axis), -1) for name, axis in self.names]
        return [[own, other] for own, other in enumerate(opposite) if other > own]
