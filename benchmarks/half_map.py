"""A map that shows half of a place: python -m benchmarks.half_map MAP OUT --towards 180.

Photographs stay whose optical axis points, seen from above, to within 90 degrees of a direction; landmarks that fewer
than three of those show go, and descriptors that the others gave.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.registration.reference_map import ReferenceMap

_VIEWS = 3  # that a landmark of a map is seen by


def half_map(reference_map: ReferenceMap, towards_deg: float) -> ReferenceMap:
    """The part of a map that the photographs give whose axis azimuth is within 90 degrees of one; it has pictures."""
    photographs = reference_map.photographs
    assert photographs is not None
    azimuths = np.arctan2(reference_map.world_T_camera[:, 1, 2], reference_map.world_T_camera[:, 0, 2])
    views = np.cos(azimuths - np.radians(towards_deg)) > 0.0
    seen = views[photographs.observation_view]
    landmarks = np.bincount(photographs.observation_landmark[seen], minlength=len(reference_map.landmark_ids)) >= _VIEWS
    looks = landmarks[reference_map.descriptor_landmark] & views[_givers(reference_map)]
    seen &= landmarks[photographs.observation_landmark]
    new_landmark, new_view = np.cumsum(landmarks) - 1, np.cumsum(views) - 1
    kept = replace(
        photographs,
        jpegs=tuple(jpeg for jpeg, keep in zip(photographs.jpegs, views, strict=True) if keep),
        camera_of_view=photographs.camera_of_view[views],
        world_T_camera=photographs.world_T_camera[views],
        observation_landmark=new_landmark[photographs.observation_landmark[seen]].astype(np.uint32),
        observation_view=new_view[photographs.observation_view[seen]].astype(np.uint16),
        normals=photographs.normals[landmarks],
    )
    return replace(
        reference_map,
        landmark_ids=reference_map.landmark_ids[landmarks],
        points_world=reference_map.points_world[landmarks],
        colours=reference_map.colours[landmarks],
        descriptor_landmark=new_landmark[reference_map.descriptor_landmark[looks]].astype(np.uint32),
        descriptors=reference_map.descriptors[looks],
        descriptor_view=reference_map.descriptor_view[looks],
        descriptor_size=reference_map.descriptor_size[looks],
        world_T_camera=reference_map.world_T_camera[views],
        image_names=tuple(name for name, keep in zip(reference_map.image_names, views, strict=True) if keep),
        photographs=kept,
    )


def _givers(reference_map: ReferenceMap) -> NDArray[np.int64]:
    """(D,) the photograph that gave each descriptor: the one that the landmark sees in its direction."""
    landmark = reference_map.descriptor_landmark
    towards = reference_map.world_T_camera[None, :, :3, 3] - reference_map.points_world[landmark][:, None]
    towards /= np.linalg.norm(towards, axis=2, keepdims=True)
    givers: NDArray[np.int64] = np.einsum("nki,ni->nk", towards, reference_map.descriptor_view).argmax(axis=1)
    return givers


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("map", type=Path)
    parser.add_argument("output", type=Path)
    parser.add_argument("--towards", type=float, default=0.0, help="azimuth of the half that stays [deg]")
    arguments = parser.parse_args()
    half = half_map(ReferenceMap.load(arguments.map), arguments.towards)
    half.save(arguments.output)
    print(f"{len(half.image_names)} photographs, {len(half.landmark_ids)} landmarks")


if __name__ == "__main__":
    main()
