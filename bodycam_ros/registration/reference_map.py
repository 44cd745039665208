"""The reference map: the landmarks of a place, their descriptors and photographs.

A body needs a map with lengths in metres, and its upright needs z up (``load_map``). A loaded map is never changed;
landmarks are added to a copy.
"""

import re
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Annotated, Any
from weakref import WeakValueDictionary

import msgspec
import numpy as np
import yaml
from numpy.typing import NDArray

from bodycam_ros.errors import MapError
from bodycam_ros.files.checked_npz import read_arrays
from bodycam_ros.files.output_place import check_folder
from bodycam_ros.files.whole_file import failure_named, whole_folder
from bodycam_ros.files.yaml_file import read_yaml
from bodycam_ros.registration.map_photographs import MapPhotographs
from bodycam_ros.registration.visual_index import VisualIndex, VisualWords, choose_words
from bodycam_ros.tracking.track_frame import find_rows

VERSION = 1
_ARRAYS_FILE = "landmarks.npz"
_SUMMARY_FILE = "map.yaml"
_PARTS = re.compile(
    r"map\.yaml|landmarks\.npz|photographs\.npz|structure\.ply|(coverage|rounds)\.png|sparse/(cameras|frames|images|points3D|rigs)\.(bin|txt)"
)

MAP_R_BOARD = "map_R_board"
"""In a map's summary: how the axes of the board turned, which the origin is on; None where no board was seen."""

_REMEDY = "build it with photographs of the AprilTag board (bodycam map)"


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
        descriptor_size: (D,) float32 size of the feature [m]: a camera that is r away, and shows f pixels per radian
            there, sees it with SIFT sigma ``descriptor_size * f / r``.
        world_T_camera: (K, 4, 4) poses of the reference photographs.
        image_names: their K file names.
        metric: whether lengths are metres; without a board the scale is arbitrary.
        gravity_aligned: whether z points up.
        photographs: pictures of the landmarks; None in maps that were made without.
        grown: how many of the landmarks, the last ones, body cameras added; others never move.
        words: of the descriptors, saved with the map; None: made when they are needed, or when the map is saved.
        summary: content of ``map.yaml``: how and from what the map was made.
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
    photographs: MapPhotographs | None = None
    grown: int = 0
    words: VisualWords | None = None
    summary: Mapping[str, Any] = field(default_factory=dict)

    @property
    def first_grown(self) -> int:
        """Row of the first landmark that body cameras added; the number of landmarks without any."""
        return len(self.landmark_ids) - self.grown

    @cached_property
    def landmark_sizes(self) -> NDArray[np.float32]:
        """(L,) float32 the largest ``descriptor_size`` of each landmark; 0 without a descriptor."""
        sizes = np.zeros(len(self.landmark_ids), np.float32)
        np.maximum.at(sizes, self.descriptor_landmark, self.descriptor_size)
        return sizes

    @cached_property
    def surfaces(self) -> NDArray[np.float32]:
        """(7, L) float32 place [m], normal and size [m] of the landmarks, as ``choose_landmarks`` takes them.

        Raises:
            ValueError: the map has no photographs, and so no normals.
        """
        if self.photographs is None:
            raise ValueError("a map without photographs has no normals")
        columns = (self.points_world.T, self.photographs.normals.T, self.landmark_sizes[None])
        return np.ascontiguousarray(np.concatenate(columns), np.float32)

    @cached_property
    def visual_index(self) -> VisualIndex:
        """Search by descriptors alone, for all cameras."""
        return VisualIndex(self.descriptors, self.descriptor_landmark, self.index_words(len(self.descriptors)))

    def index_words(self, count: int) -> VisualWords:
        """Visual words of so many of the first descriptors."""
        if self.words is not None and len(self.words.word_of_descriptor) == count:
            return self.words
        return choose_words(self.descriptors[:count])

    @cached_property
    def _by_id(self) -> NDArray[np.int64]:
        return np.argsort(self.landmark_ids, kind="stable")

    def rows_of(self, landmark_ids: NDArray[np.uint32]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Rows (N,) of landmarks, and whether each is in the map; rows of absent ones are meaningless."""
        return find_rows(self.landmark_ids, landmark_ids, self._by_id)

    @classmethod
    def load(cls, path: Path | str) -> "ReferenceMap":
        """Read a map folder.

        Raises:
            MapError: there is no map, it is of another version, damaged or empty.
        """
        path = Path(path)
        if not path.exists():
            raise MapError(f"{path}: there is no map folder; make one with 'bodycam map REFERENCE_DIR -o {path}'")
        if not (path / _SUMMARY_FILE).exists():
            what = f"has no {_SUMMARY_FILE}" if path.is_dir() else "is a file"
            raise MapError(f"{path}: {what}; expected a map, a folder that 'bodycam map' wrote")
        header, summary = _read_header(path / _SUMMARY_FILE)
        if header.version != VERSION:
            raise MapError(
                f"{path}: the map has version {header.version}, this program reads {VERSION}; build it again with "
                "'bodycam map'"
            )
        arrays = read_arrays(path / _ARRAYS_FILE, _ARRAYS, _WORDS)
        names = arrays.pop("image_names")
        words = [arrays.pop(name) for name in _WORDS if name in arrays]
        reference_map = cls(
            **arrays,
            image_names=tuple(map(str, names)),
            metric=header.metric,
            gravity_aligned=header.gravity_aligned,
            photographs=MapPhotographs.load(path, arrays["world_T_camera"], len(arrays["landmark_ids"])),
            words=VisualWords(*words) if len(words) == len(_WORDS) else None,
            grown=header.grown_landmarks,
            summary=summary,
        )
        reference_map._check(path)
        return reference_map

    def save(self, path: Path, *, force: bool = False, also: Callable[[Path], None] | None = None) -> None:
        """Write the map folder whole or not at all.

        Args:
            path: folder to create.
            force: replace a map that is there.
            also: writes further files into the folder before it appears under its name.

        Raises:
            OutputError: something is at ``path`` that must not be replaced, or the disk refuses.
            MapError: it has values that are not finite, so that it could not be read again.
        """
        words = self.index_words(len(self.descriptors))
        arrays: dict[str, Any] = dict(zip(_WORDS, (words.centres, words.word_of_descriptor), strict=True))
        arrays |= {name: np.asarray(getattr(self, name), form.split()[0]) for name, form in _ARRAYS.items()}
        for name, values in arrays.items():
            if values.dtype.kind == "f" and not np.isfinite(values).all():
                raise MapError(
                    f"{path}: the map would have {name} that are not finite numbers, so it is not written; check "
                    "that the photographs, their camera.yaml and board.yaml belong together"
                )
        header = msgspec.to_builtins(_Header(VERSION, self.metric, self.gravity_aligned, self.grown))
        document = header | {name: value for name, value in self.summary.items() if name not in header}
        with whole_folder(path, partial(check_replaceable, force=force)) as folder, failure_named(path):
            folder.mkdir()
            np.savez(folder / _ARRAYS_FILE, **arrays)
            if self.photographs is not None:
                self.photographs.save(folder)
            (folder / _SUMMARY_FILE).write_text(yaml.safe_dump(document, sort_keys=False, width=120))
            if also is not None:
                also(folder)

    def _check(self, path: Path) -> None:
        landmarks, descriptors = len(self.landmark_ids), len(self.descriptors)
        if self.words is not None and not self.words.fit(descriptors):
            raise MapError(f"{path}: damaged: visual words do not fit the descriptors; build the map again")
        if landmarks == 0 or descriptors == 0:
            raise MapError(
                f"{path}: the map is empty ({landmarks} landmarks, {descriptors} descriptors); build it again"
            )
        owners = self.descriptor_landmark.astype(np.int64)
        if owners.max() >= landmarks or np.any(np.diff(owners) < 0) or self.grown > landmarks:
            raise MapError(f"{path}: damaged: descriptors do not follow the landmarks; build the map again")


_ARRAYS = {
    "landmark_ids": "u4 L",
    "points_world": "f8 L 3",
    "colours": "u1 L 3",
    "descriptor_landmark": "u4 D",
    "descriptors": "u1 D 128",
    "descriptor_view": "f4 D 3",
    "descriptor_size": "f4 D",
    "world_T_camera": "f8 K 4 4",
    "image_names": "U K",
}
"""Arrays of the file, as of ``read_arrays``; the names are those of ``ReferenceMap``."""

_WORDS = {"word_centres": "u1 W 128", "word_of_descriptor": "u2 D"}
"""Arrays of ``VisualWords``, which maps of older versions lack."""


def check_replaceable(path: Path, force: bool) -> None:
    """Check that a map may be written at a path: nothing is there, or a map and ``force``.

    Raises:
        OutputError: it may not.
    """
    if path.exists():
        check_folder(path, force, _SUMMARY_FILE, _PARTS, "map")


class _Header(msgspec.Struct):
    """What ``map.yaml`` must hold of a map; the rest of it documents how the map was made."""

    version: int
    metric: bool
    gravity_aligned: bool
    grown_landmarks: Annotated[int, msgspec.Meta(ge=0)] = 0


def _read_header(path: Path) -> tuple[_Header, dict[str, Any]]:
    """The header of a map, and all of its summary."""
    summary = read_yaml(path, "summary of a map", MapError)
    try:
        return msgspec.convert(summary, _Header), summary
    except msgspec.ValidationError as error:
        raise MapError(f"{path}: no summary of a map: {error}") from error


ASSUMED_VERTICAL = (
    "the upward axis of this map is unknown. The body is solved, but z of the output is the z axis of the board, which "
    "points up only if the board lay flat"
)
"""A warning where a body is solved in a map that is not ``gravity_aligned``."""

_lock = threading.Lock()
_loaded: WeakValueDictionary[tuple[Path, int], ReferenceMap] = WeakValueDictionary()
"""Folder and time of its last change -> map, for as long as it is used."""


def load_map(path: Path, upright: bool = False) -> ReferenceMap:
    """Read a metric map, once for all nodes of a process: a body and its accelerations need a size.

    Args:
        path: folder.
        upright: whether its z has to be up: the N-pose needs a vertical.

    Raises:
        MapError: as of ``ReferenceMap.load``; or it is not metric, or its z is not up.
    """
    with _lock:
        key = (path.absolute(), path.stat().st_mtime_ns if path.exists() else 0)
        reference_map = _loaded.get(key)
        if reference_map is None:
            reference_map = _loaded[key] = ReferenceMap.load(path)
    if not reference_map.metric:
        raise MapError(f"{path}: this map has no scale, and bodies are metric; {_REMEDY}")
    if upright and not reference_map.gravity_aligned:
        raise MapError(
            f"{path}: the upward axis of this map is unknown, but the N-pose needs it; {_REMEDY}, whose 'placement' "
            "must name the axis that points up"
        )
    return reference_map
