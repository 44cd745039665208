"""What the campaign damages: small good inputs, made once; and the runs of the real commands on copies of them."""

import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from helpers.altered_sample import CAMERAS, write_altered_sample
from helpers.recorded_progress import Unshown

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.urdf import urdf_text
from bodycam_ros.formats.export import export
from bodycam_ros.formats.sampled_motion import MotionOptions
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.replaying.replay import replay as replay_recording
from bodycam_ros.replaying.replay_request import ReplayRequest

REPOSITORY = Path(__file__).parents[2]
_SAMPLE = REPOSITORY / "bags"
_PHOTOGRAPHS = ("ref_0099.jpg", "ref_0101.jpg", "ref_0103.jpg", "ref_0105.jpg", "camera.yaml", "board.yaml")
_FRAMES = 4
_POINTS = ("spine", "knee_left", "knee_right", "hip_left", "hip_right", "shoulder_left", "ankle_left", "ankle_right")
WALK_CAMERAS, WALK_FRAMES = ("waist_front", "torso_front", "thigh_left", "shin_left"), 42
"""Cameras of the recording ``walk``, of which streams are broken."""
_QUICK_MAP = ("--features.max_features", "1200", "--jobs", "1")


def make_stock(folder: Path) -> None:
    """Write what the cases damage: recording, walk, solved, map, reference, truth, body.yaml, equipment.yaml, ..."""
    write_altered_sample(_SAMPLE, folder / "recording", frames=_FRAMES)
    write_altered_sample(_SAMPLE, folder / "walk", cameras=WALK_CAMERAS, frames=WALK_FRAMES)
    (folder / "reference").mkdir()
    for name in _PHOTOGRAPHS:
        shutil.copyfile(_SAMPLE / "reference" / name, folder / "reference" / name)
    shutil.copytree(_SAMPLE / "sample" / "truth", folder / "truth" / "truth")
    shutil.copyfile(_SAMPLE / "sample" / "rig.yaml", folder / "truth" / "rig.yaml")
    shutil.copyfile(_SAMPLE / "body.yaml", folder / "body.yaml")
    rig = read_body(_SAMPLE / "body.yaml")
    (folder / "body.urdf").write_text(urdf_text(rig))
    parents = {joint.child: joint.parent for joint in rig.tree_joints}
    lines = [f"cameras: {{{', '.join(f'{camera}: {rig.mounts[camera].segment}' for camera in CAMERAS)}}}", "segments:"]
    lines += [f"  {segment}: {parents.get(segment, 'null')}" for segment in rig.segments]
    (folder / "rig.yaml").write_text("\n".join(lines) + "\n")
    shutil.copyfile(REPOSITORY / "config/all_settings.yaml", folder / "settings.yaml")
    shutil.copyfile(REPOSITORY / "config/equipment/bicycle.yaml", folder / "equipment.yaml")
    _write_small_map(folder)
    map_path, body = folder / "map", folder / "body.yaml"
    replay_recording(ReplayRequest(folder / "recording", map_path, body, folder / "solved", PipelineSettings(), jobs=1))
    replay_recording(ReplayRequest(folder / "walk", map_path, body, folder / "walked", PipelineSettings(), jobs=1))
    with TemporaryDirectory() as place:
        export([folder / "walked"], "trc", Path(place) / "points.trc", False, MotionOptions(), Unshown())
        shutil.copyfile(Path(place) / "points.trc", folder / "points.trc")
    (folder / "points.yaml").write_text("".join(f"{name}: {name}\n" for name in _POINTS))


def _write_small_map(folder: Path) -> None:
    """The landmarks that the walk shows: a map of a tenth of the size, which every case loads."""
    replay_recording(
        ReplayRequest(
            folder / "walk",
            _SAMPLE / "map",
            folder / "body.yaml",
            folder / "full",
            PipelineSettings(),
            jobs=len(WALK_CAMERAS),
        )
    )
    with BagFile(folder / "full") as bag:
        topics = [f"/{camera}/landmarks" for camera in WALK_CAMERAS]
        seen = {int(number) for _, _, message in bag.messages(topics) for number in message.landmark_ids}
    shutil.rmtree(folder / "full")
    whole = ReferenceMap.load(_SAMPLE / "map")
    rows = np.flatnonzero(np.isin(whole.landmark_ids, sorted(seen - {0})))
    described = np.flatnonzero(np.isin(whole.descriptor_landmark, rows))
    of_landmarks: dict[str, Any] = {
        name: getattr(whole, name)[rows] for name in ("landmark_ids", "points_world", "colours")
    }
    of_descriptors = {n: getattr(whole, n)[described] for n in ("descriptors", "descriptor_view", "descriptor_size")}
    landmark = np.searchsorted(rows, whole.descriptor_landmark[described]).astype(np.uint32)
    photographs = whole.photographs
    assert photographs is not None
    observed = np.flatnonzero(np.isin(photographs.observation_landmark, rows))
    of_landmarks["photographs"] = replace(
        photographs,
        observation_landmark=np.searchsorted(rows, photographs.observation_landmark[observed]).astype(np.uint32),
        observation_view=photographs.observation_view[observed],
        normals=photographs.normals[rows],
    )
    replace(whole, **of_landmarks, **of_descriptors, descriptor_landmark=landmark).save(folder / "map")


@dataclass(frozen=True)
class Attempt:
    """One run of ``bodycam``.

    Attributes:
        arguments: of the command line.
        outputs: path -> kind of what may be there afterwards, if it is whole: bag, body, page, urdf, report, map.
        ordinary_user: run without the rights of root.
        largest_file: the disk takes files up to this size [bytes].
        stop: signal number and seconds after the start at which it comes; in a real process.
        is_good: nothing is wrong with it, so it has to succeed.
        must_say: pattern that what is printed beside the tables has to match, if the run ends with 0.
    """

    arguments: tuple[str, ...]
    outputs: Mapping[Path, str] = field(default_factory=dict)
    ordinary_user: bool = False
    largest_file: int | None = None
    stop: tuple[int, float] | None = None
    is_good: bool = False
    must_say: str = ""


@dataclass(frozen=True)
class Work:
    """A folder of one case, and the stock that it may read.

    Attributes:
        folder: of the case, empty at first.
        stock: what ``make_stock`` wrote; nobody writes to it.
    """

    folder: Path
    stock: Path

    def own(self, name: str) -> Path:
        """A copy of something of the stock, to be damaged; the same one if it is there already."""
        target = self.folder / name
        if not target.exists():
            target.parent.mkdir(parents=True, exist_ok=True)
            copy = shutil.copytree if (self.stock / name).is_dir() else shutil.copyfile
            copy(self.stock / name, target)
        return target

    def of(self, name: str) -> Path:
        """The case's own copy if it has one, else that of the stock."""
        own = self.folder / name
        return own if own.exists() or own.is_symlink() else self.stock / name

    def replay(
        self, *more: str, out: Path | None = None, body: str = "body.yaml", recording: str = "recording"
    ) -> Attempt:
        """Bodycam replay."""
        out = out or self.folder / "out"
        inputs = (self.of(recording), "--map", self.of("map"), "--body", self.of(body))
        arguments = ("replay", *map(str, inputs), "-o", str(out), "--jobs", "1", *more)
        return Attempt(arguments, {out: "bag"})

    def body(self, *more: str, out: Path | None = None) -> Attempt:
        """Bodycam body."""
        out = out or self.folder / "made.yaml"
        inputs = (self.of("recording"), "--map", self.of("map"), "--rig", self.of("rig.yaml"))
        arguments = ("body", *map(str, inputs), "-o", str(out), "--jobs", "1", *more)
        return Attempt(arguments, {out: "body", out.with_suffix(".html"): "page"} if out.suffix else {out: "body"})

    def map(self, *more: str, out: Path | None = None) -> Attempt:
        """Bodycam map."""
        out = out or self.folder / "made"
        return Attempt(("map", str(self.of("reference")), "-o", str(out), *_QUICK_MAP, *more), {out: "map"})

    def evaluate(self, *more: str, out: Path | None = None, solved: str = "solved") -> Attempt:
        """Bodycam evaluate."""
        out = out or self.folder / "report"
        return Attempt(("evaluate", str(self.of(solved)), "-o", str(out), *more), {out: "report"})

    def export_motion(self, to: str) -> Attempt:
        """Bodycam export of a longer motion, in any format."""
        out = self.folder / f"made.{to}"
        made = {out: "file", out.with_suffix(".osim"): "file"} if to in ("trc", "mot") else {out: "file"}
        return Attempt(("export", str(self.of("walked")), "--to", to, "-o", str(out)), made)

    def export(self, source: str = "solved", out: Path | None = None) -> Attempt:
        """Bodycam export."""
        out = out or self.folder / "made.urdf"
        return Attempt(("export", str(self.of(source)), "--to", "urdf", "-o", str(out)), {out: "urdf"})


Make = Callable[[Work, np.random.Generator], Attempt]
"""Prepares a case: damages what it owns, and says what to run."""
