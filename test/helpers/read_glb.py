"""A GLB with an animation, read by pygltflib: where nodes and the skin are at each key."""

from pathlib import Path

import numpy as np
import pygltflib
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
OURS_R_SCENE = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


class ReadGlb:
    """A GLB with its animation, by its nodes' names; in our axes."""

    def __init__(self, path: Path) -> None:
        self.file = pygltflib.GLTF2().load(str(path))
        self.parents = {child: row for row, node in enumerate(self.file.nodes) for child in node.children or ()}
        self.rows = {node.name: row for row, node in enumerate(self.file.nodes)}
        (animation,) = self.file.animations
        self.seconds = self.accessor(animation.samplers[0].input)[:, 0]
        self.keys = {
            (channel.target.node, channel.target.path): self.accessor(animation.samplers[channel.sampler].output)
            for channel in animation.channels
        }

    def accessor(self, row: int) -> Array:
        accessor = self.file.accessors[row]
        view = self.file.bufferViews[accessor.bufferView]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}[accessor.type]
        data = self.file.binary_blob()[view.byteOffset : view.byteOffset + view.byteLength]
        kind = {5126: "<f4", 5121: "u1"}[accessor.componentType]
        return np.frombuffer(data, kind).reshape(accessor.count, width).astype(np.float64)

    def world(self, row: int, moved: bool = True) -> Array:
        """(T, 4, 4) poses with scale of a node in the scene; as it rests if it is not moved."""
        node, count = self.file.nodes[row], len(self.seconds)
        parts = {}
        for path, rest in (("translation", (0.0,) * 3), ("rotation", (0.0, 0.0, 0.0, 1.0)), ("scale", (1.0,) * 3)):
            own = np.tile(np.array(getattr(node, path) or rest, float), (count, 1))
            parts[path] = self.keys.get((row, path), own) if moved else own
        local = np.tile(np.eye(4), (count, 1, 1))
        local[:, :3, :3] = Rotation.from_quat(parts["rotation"]).as_matrix() * parts["scale"][:, None]
        local[:, :3, 3] = parts["translation"]
        return self.world(self.parents[row], moved) @ local if row in self.parents else local

    def places(self, bone: str) -> Array:
        """(T, 3) where a bone begins, in our axes."""
        return self.world(self.rows[bone])[:, :3, 3] @ OURS_R_SCENE.T

    def skin(self, moved: bool) -> Array:
        """(T, V, 3) points of the skin in the scene."""
        joints = self.file.skins[0].joints
        bind = self.accessor(self.file.skins[0].inverseBindMatrices).reshape(-1, 4, 4).transpose(0, 2, 1)
        skinned = next(node for node in self.file.nodes if node.skin is not None)
        attributes = self.file.meshes[skinned.mesh].primitives[0].attributes
        owners = self.accessor(attributes.JOINTS_0)[:, 0].astype(int)
        poses = np.stack([self.world(joint, moved) for joint in joints], axis=1) @ bind
        points = self.accessor(attributes.POSITION)
        return np.einsum("tvij,vj->tvi", poses[:, owners], np.column_stack([points, np.ones(len(points))]))[..., :3]
