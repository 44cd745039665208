"""A map of any number of landmarks, made of one that there is: thinned, or with copies of its place beside it."""

from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.registration.reference_map import ReferenceMap

Row = TypeVar("Row", np.uint16, np.uint32)

_APART = 1.5  # times the map's width along x, from one copy to the next
_CHANGED_BY = 8  # at most, in every entry of a copy's descriptors: about as much as another photograph would


def scaled_map(reference_map: ReferenceMap, landmarks: int) -> ReferenceMap:
    """The map with so many landmarks; it looks the same where the first copy is, and elsewhere nearly so.

    Args:
        reference_map: the map.
        landmarks: how many it is to have; copies are thinned where they would be more.
    """
    count = len(reference_map.landmark_ids)
    copies = -(-landmarks // count)
    width = float(np.ptp(reference_map.points_world[:, 0]))
    shares = np.diff(np.linspace(0, landmarks, copies + 1).astype(np.int64))
    whole = shares.min() == count
    parts = []
    for number, share in enumerate(shares.tolist()):
        part = reference_map if whole else _thinned(reference_map, share)
        parts.append(_moved(part, number, _APART * number * width) if number else part)
    return replace(_joined(parts), grown=0)


def _thinned(reference_map: ReferenceMap, landmarks: int) -> ReferenceMap:
    """So many of the landmarks, evenly."""
    count = len(reference_map.landmark_ids)
    rows = np.linspace(0, count - 1, landmarks).astype(np.int64)
    new_row = np.full(count, -1)
    new_row[rows] = np.arange(landmarks)
    looks = new_row[reference_map.descriptor_landmark] >= 0
    photographs = reference_map.photographs
    if photographs is not None:
        seen = new_row[photographs.observation_landmark] >= 0
        photographs = replace(
            photographs,
            observation_landmark=new_row[photographs.observation_landmark[seen]].astype(np.uint32),
            observation_view=photographs.observation_view[seen],
            normals=photographs.normals[rows],
        )
    return replace(
        reference_map,
        landmark_ids=reference_map.landmark_ids[rows],
        points_world=reference_map.points_world[rows],
        colours=reference_map.colours[rows],
        descriptor_landmark=new_row[reference_map.descriptor_landmark[looks]].astype(np.uint32),
        descriptors=reference_map.descriptors[looks],
        descriptor_view=reference_map.descriptor_view[looks],
        descriptor_size=reference_map.descriptor_size[looks],
        photographs=photographs,
    )


def _moved(reference_map: ReferenceMap, seed: int, along_x: float) -> ReferenceMap:
    """The same place elsewhere [m], seen a little otherwise."""
    shift = np.array([along_x, 0.0, 0.0])
    world_T_camera = reference_map.world_T_camera.copy()
    world_T_camera[:, :3, 3] += shift
    noise = np.random.default_rng(seed).integers(
        -_CHANGED_BY, _CHANGED_BY + 1, reference_map.descriptors.shape, np.int16
    )
    photographs = reference_map.photographs
    return replace(
        reference_map,
        points_world=reference_map.points_world + shift,
        descriptors=np.clip(reference_map.descriptors + noise, 0, 255).astype(np.uint8),
        world_T_camera=world_T_camera,
        photographs=None if photographs is None else replace(photographs, world_T_camera=world_T_camera),
    )


def _joined(parts: list[ReferenceMap]) -> ReferenceMap:
    """Maps as one; landmarks are numbered anew."""
    first_landmark = np.cumsum([0, *(len(part.landmark_ids) for part in parts)])
    world_T_camera = np.concatenate([part.world_T_camera for part in parts])
    photographs = [part.photographs for part in parts if part.photographs is not None]
    joined = None
    if photographs:
        first_view = np.cumsum([0, *(len(part.world_T_camera) for part in photographs)])
        joined = replace(
            photographs[0],
            jpegs=tuple(jpeg for part in photographs for jpeg in part.jpegs),
            camera_of_view=np.concatenate([part.camera_of_view for part in photographs]),
            world_T_camera=world_T_camera,
            observation_landmark=_numbered([part.observation_landmark for part in photographs], first_landmark),
            observation_view=_numbered([part.observation_view for part in photographs], first_view),
            normals=np.concatenate([part.normals for part in photographs]),
        )
    return replace(
        parts[0],
        landmark_ids=np.arange(first_landmark[-1], dtype=np.uint32),
        points_world=np.concatenate([part.points_world for part in parts]),
        colours=np.concatenate([part.colours for part in parts]),
        descriptor_landmark=_numbered([part.descriptor_landmark for part in parts], first_landmark),
        descriptors=np.concatenate([part.descriptors for part in parts]),
        descriptor_view=np.concatenate([part.descriptor_view for part in parts]),
        descriptor_size=np.concatenate([part.descriptor_size for part in parts]),
        world_T_camera=world_T_camera,
        image_names=tuple(name for part in parts for name in part.image_names),
        photographs=joined,
    )


def _numbered(rows: list[NDArray[Row]], first: NDArray[np.int64]) -> NDArray[Row]:
    """Rows of every part as rows of the whole."""
    return np.concatenate([part + part.dtype.type(begin) for part, begin in zip(rows, first, strict=False)])
