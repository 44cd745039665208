"""The reference map: what a place looks like and where its landmarks are."""

import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from bodycam_ros.errors import MapError
from bodycam_ros.whole_file import failure_named, whole_folder

VERSION = 1
_ARRAYS_FILE = "landmarks.npz"
_SUMMARY_FILE = "map.yaml"


@dataclass(frozen=True)
class ReferenceMap:
    """Landmarks of a place with their descriptors, and the poses of the photographs that gave them.

    World is the map frame: metric with z up and its origin on the board if ``metric`` and ``gravity_aligned``.

    Attributes:
        landmark_ids: (L,) uint32; the point's id in the COLMAP model too.
        points_world: (L, 3) float64 [m].
        colours: (L, 3) uint8 red, green, blue.
        descriptor_landmark: (D,) uint32 row of the landmark that a descriptor belongs to, ascending.
        descriptors: (D, 128) uint8 RootSIFT.
        descriptor_view: (D, 3) float32 unit direction from the landmark to the camera that gave the descriptor.
        descriptor_size: (D,) float32 SIFT sigma [px] * depth / focal length [m]: where a camera of focal length f [px]
            sees the landmark at depth z, the feature has sigma ``descriptor_size * f / z``.
        world_T_camera: (K, 4, 4) poses of the reference photographs.
        image_names: their K file names.
        metric: whether lengths are metres; without a board the scale is arbitrary.
        gravity_aligned: whether z points up.
        summary: what ``map.yaml`` says: how and from what the map was made.
    """

    landmark_ids: NDArray[np.uint32]
    points_world: NDArray[np.float64]
    colours: NDArray[np.uint8]
    descriptor_landmark: NDArray[np.uint32]
    descriptors: NDArray[np.uint8]
    descriptor_view: NDArray[np.float32]
    descriptor_size: NDArray[np.float32]
    world_T_camera: NDArray[np.float64]
    image_names: tuple[str, ...]
    metric: bool
    gravity_aligned: bool
    summary: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def landmark_sizes(self) -> NDArray[np.float32]:
        """(L,) float32 the largest ``descriptor_size`` of each landmark; 0 without a descriptor."""
        sizes = np.zeros(len(self.landmark_ids), np.float32)
        np.maximum.at(sizes, self.descriptor_landmark, self.descriptor_size)
        return sizes

    @classmethod
    def load(cls, path: Path) -> "ReferenceMap":
        """Read a map folder.

        Raises:
            MapError: there is no map, it is of another version, damaged or empty.
        """
        if not path.is_dir():
            raise MapError(f"{path}: there is no map folder; make one with 'bodycam map REFERENCE_DIR -o {path}'")
        summary = _read_summary(path / _SUMMARY_FILE)
        if summary.get("version") != VERSION:
            raise MapError(
                f"{path}: the map has version {summary.get('version')!r}, this program reads {VERSION}; "
                "build it again with 'bodycam map'"
            )
        try:
            with np.load(path / _ARRAYS_FILE, allow_pickle=False) as arrays:
                reference_map = cls(
                    **{name: arrays[name] for name in _ARRAY_NAMES},
                    image_names=tuple(arrays["image_names"].tolist()),
                    metric=bool(summary["metric"]),
                    gravity_aligned=bool(summary["gravity_aligned"]),
                    summary=summary,
                )
        except (OSError, KeyError, ValueError, EOFError, zipfile.BadZipFile, zipfile.LargeZipFile) as error:
            raise MapError(f"{path / _ARRAYS_FILE}: damaged or incomplete ({error}); build the map again") from error
        reference_map._check(path)
        return reference_map

    def save(self, path: Path, *, force: bool = False, also: Callable[[Path], None] | None = None) -> None:
        """Write the map folder whole or not at all.

        Args:
            path: folder to create.
            force: replace a map that is there.
            also: writes further files into the folder that it is given, before the folder appears.

        Raises:
            MapError: something is at ``path`` that must not be replaced.
            OutputError: the disk refuses.
        """
        arrays: dict[str, Any] = {name: getattr(self, name) for name in _ARRAY_NAMES}
        summary = {"version": VERSION, "metric": self.metric, "gravity_aligned": self.gravity_aligned}
        document = {**summary, **{k: v for k, v in self.summary.items() if k not in summary}}
        with whole_folder(path, partial(check_replaceable, force=force)) as folder, failure_named(path):
            folder.mkdir()
            np.savez_compressed(folder / _ARRAYS_FILE, image_names=np.array(self.image_names, dtype=np.str_), **arrays)
            (folder / _SUMMARY_FILE).write_text(yaml.safe_dump(document, sort_keys=False, width=120))
            if also is not None:
                also(folder)

    def _check(self, path: Path) -> None:
        landmarks, descriptors, cameras = len(self.landmark_ids), len(self.descriptors), len(self.image_names)
        shapes = {
            "landmark_ids": (landmarks,),
            "points_world": (landmarks, 3),
            "colours": (landmarks, 3),
            "descriptor_landmark": (descriptors,),
            "descriptors": (descriptors, 128),
            "descriptor_view": (descriptors, 3),
            "descriptor_size": (descriptors,),
            "world_T_camera": (cameras, 4, 4),
        }
        for name, shape in shapes.items():
            array = getattr(self, name)
            if array.shape != shape:
                raise MapError(
                    f"{path}: damaged: {name} has shape {array.shape}, expected {shape}; build the map again"
                )
            if array.dtype.kind == "f" and not np.isfinite(array).all():
                raise MapError(f"{path}: damaged: {name} holds values that are not finite; build the map again")
        if landmarks == 0 or descriptors == 0:
            raise MapError(
                f"{path}: the map is empty ({landmarks} landmarks, {descriptors} descriptors); build it again"
            )
        if int(self.descriptor_landmark.max()) >= landmarks or np.any(
            np.diff(self.descriptor_landmark.astype(np.int64)) < 0
        ):
            raise MapError(f"{path}: damaged: descriptors do not follow the landmarks; build the map again")


_ARRAY_NAMES = tuple(
    f.name for f in fields(ReferenceMap) if f.name not in ("image_names", "metric", "gravity_aligned", "summary")
)


def check_replaceable(path: Path, force: bool) -> None:
    """Raise MapError unless a map may be written to ``path``: nothing there, or with ``force`` a map."""
    if not path.exists():
        return
    if not force:
        raise MapError(f"{path}: exists already; choose another name or replace it with --force")
    if not (path / _SUMMARY_FILE).is_file():
        raise MapError(f"{path}: is not a map (it has no {_SUMMARY_FILE}), so --force does not replace it")


def _read_summary(path: Path) -> dict[str, Any]:
    try:
        summary = yaml.safe_load(path.read_text())
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise MapError(f"{path.parent}: not a map: {path.name} cannot be read ({error})") from error
    if not isinstance(summary, dict):
        raise MapError(f"{path.parent}: not a map: {path.name} should say how the map was made")
    return summary
