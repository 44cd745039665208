"""Pictures of a flat textured wall, exact ray by ray, for cameras of any lens."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import exp_se3

_RAYS = 3  # a side of each pixel
_TEXEL_M = 0.004
_SIDE_M = 8.0


def texture_of(seed: int, grain_m: float = 0.03) -> NDArray[np.float32]:
    """Light of a wall (rows, columns), with detail at every scale above ``grain_m``."""
    random = np.random.default_rng(seed)
    side = round(_SIDE_M / _TEXEL_M)
    light = np.zeros((side, side), np.float32)
    for scale in (1.0, 2.0, 4.0, 8.0, 16.0):
        coarse = random.normal(size=2 * [round(_SIDE_M / (grain_m * scale))]).astype(np.float32)
        light += cv2.resize(coarse, (side, side), interpolation=cv2.INTER_CUBIC)
    return np.asarray(np.clip(127.0 + 30.0 * light, 10.0, 245.0), np.float32)


@dataclass(frozen=True)
class Wall:
    """A square wall around the origin of the plane z = 0 of a frame, with the light of ``texture``.

    Attributes:
        world_T_wall: (4, 4); whoever sees it stands at positive z.
        texture: see ``texture_of``.
    """

    world_T_wall: NDArray[np.float64]
    texture: NDArray[np.float32]

    @property
    def normal(self) -> NDArray[np.float64]:
        return self.world_T_wall[:3, 2]

    def points(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """World points (N, 3) at places (N, 2) on the wall [m]."""
        return xy @ self.world_T_wall[:3, :2].T + self.world_T_wall[:3, 3]

    def light(
        self,
        camera: CameraModel,
        world_T_camera: NDArray[np.float64],
        twist: NDArray[np.float64] | None = None,
        readout_time: float = 0.0,
    ) -> NDArray[np.float64]:
        """What a camera sees (H, W): grey levels, 0 beside the wall and outside the lens.

        With a twist (6,) every row is exposed at its own time, within ``readout_time`` [s] around the middle one.
        """
        columns, rows = np.meshgrid(np.arange(camera.width * _RAYS), np.arange(camera.height * _RAYS))
        pixels = (np.stack([columns.ravel(), rows.ravel()], axis=1) + 0.5) / _RAYS - 0.5
        bearings, _ = camera.unproject(pixels)
        if twist is None:
            poses = world_T_camera[None]
            of_row = np.zeros(len(pixels), np.int64)
        else:
            shares = ((np.arange(camera.height * _RAYS) + 0.5) / _RAYS - 0.5) / (camera.height - 1) - 0.5
            poses = world_T_camera @ exp_se3((readout_time * shares)[:, None] * twist)
            of_row = rows.ravel()
        wall_R_camera = np.einsum("ji,njk->nik", self.world_T_wall[:3, :3], poses[:, :3, :3])
        centres = (poses[:, :3, 3] - self.world_T_wall[:3, 3]) @ self.world_T_wall[:3, :3]
        directions = (
            bearings @ wall_R_camera[0].T
            if len(poses) == 1
            else np.einsum("nij,nj->ni", wall_R_camera[of_row], bearings)
        )
        with np.errstate(all="ignore"):
            at = centres[of_row] - directions * (centres[of_row, 2:] / directions[:, 2:])
        hit = np.isfinite(at).all(axis=1) & (directions[:, 2] * centres[of_row, 2] < 0.0)
        texels = np.where(hit[:, None], (at[:, :2] + 0.5 * _SIDE_M) / _TEXEL_M - 0.5, -1e4).clip(-1e4, 1e4)
        shape = (camera.height * _RAYS, camera.width * _RAYS)
        across, down = (texels[:, i].reshape(shape).astype(np.float32) for i in range(2))
        seen = cv2.remap(self.texture, across, down, cv2.INTER_LINEAR, borderValue=0)
        return np.asarray(
            cv2.resize(seen, (camera.width, camera.height), interpolation=cv2.INTER_AREA), dtype=np.float64
        )


def exposed(light: NDArray[np.float64], gain: float = 1.0, bias: float = 0.0, gamma: float = 1.0) -> NDArray[np.uint8]:
    """The picture (H, W) of light."""
    grey = 255.0 * (np.clip(light, 0.0, 255.0) / 255.0) ** gamma
    return np.rint(np.clip(gain * grey + bias, 0.0, 255.0)).astype(np.uint8)
