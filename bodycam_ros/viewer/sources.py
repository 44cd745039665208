"""The files of a view, read and checked before the page is served."""

from pathlib import Path

from bodycam_ros.body.average_person import with_hands
from bodycam_ros.body.body_file import URDF_SUFFIX
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.segment_name import SegmentName
from bodycam_ros.errors import RecordingError, ViewError
from bodycam_ros.formats.static_cameras_file import check_static_cameras_frame, read_static_cameras
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.results.provenance import warn_of_differences
from bodycam_ros.results.topics import published_body
from bodycam_ros.viewer.correction import BodyFile
from bodycam_ros.viewer.motion import Motion, read_motion


class Sources:
    """What is shown; without ``body_path`` the body is that of OUT.

    Attributes:
        body_file: where the body comes from and is written to; None of a body that OUT describes.
        body: as it was read.
        reference_map: the place; None where only static cameras are given.
        motion: of the body.
        solved: the bag that the motion is from; None: the body in its N-pose.
        recording: the bag with images.
        cameras: of the body, and static ones, that have images.
        stations: static cameras.
        surface: folder of the body's meshes, instead of the body's own.

    Raises:
        BodycamError: one of the files is missing or damaged, or they do not fit each other.
    """

    def __init__(
        self,
        solved: Path | None,
        map_path: Path | None,
        body_path: Path | None,
        recording: Path | None,
        static_cameras_path: Path | None = None,
        surface: Path | None = None,
    ) -> None:
        if body_path is None and solved is None:
            raise ViewError("the body is unknown: give its file with --body, or name OUT, which describes it")
        if recording is not None and solved is None:
            place = f"--stations {static_cameras_path}" if map_path is None else f"--map {map_path}"
            raise ViewError(
                f"{recording}: without OUT the body's motion in these images is unknown; solve them first with "
                f"'bodycam replay {recording} {place} --body {body_path} -o OUT', then name OUT here too"
            )
        if map_path is None and static_cameras_path is None and solved is None:
            raise ViewError("no place: give its reference map with --map, or its static cameras with --stations")
        published: BodyModel | None = None
        if solved is not None:
            if solved.suffix.lower() in (".yaml", ".yml", URDF_SUFFIX):
                raise ViewError(f"{solved}: is not a solved bag; give a body's file with --body")
            with BagFile(solved) as bag:
                published = published_body(bag)
        self.solved = solved
        self.recording = recording
        self.surface = surface
        self.body_file = None if body_path is None else BodyFile(body_path)
        if self.body_file is not None:
            # A replay with static cameras adds hands.
            segments = () if published is None else published.segments
            kinds = {SegmentName(segment).kind for segment in segments}
            has_hands = "hand" in kinds or (solved is None and static_cameras_path is not None)
            self.body = self.body_file.read()
            if has_hands:
                self.body = with_hands(self.body)
        elif published is not None:
            self.body = published
        else:
            raise ViewError(f"{solved}: does not describe its body; give the body's file with --body")
        self.reference_map = None if map_path is None else ReferenceMap.load(map_path)
        self.stations = (
            {} if static_cameras_path is None else read_static_cameras(static_cameras_path, self.reference_map)
        )
        if static_cameras_path is not None and solved is not None:
            check_static_cameras_frame(static_cameras_path, solved, map_path)
        if solved is not None:
            given_map = None if self.reference_map is None or map_path is None else (self.reference_map, map_path)
            given_body = None if self.body_file is None or body_path is None else (self.body_file.read(), body_path)
            warn_of_differences(solved, given_map, given_body)
        self.motion = Motion.standing(self.body) if solved is None else read_motion(solved, self.body)
        self.cameras: tuple[str, ...] = ()
        if recording is not None:
            with open_recording(recording) as bag:
                self.cameras = tuple(camera for camera in (*self.body.mounts, *self.stations) if camera in bag.cameras)
                if not self.cameras:
                    raise RecordingError(
                        f"{recording}: has none of the body's cameras; it has {', '.join(bag.cameras)}, the body "
                        f"{', '.join(self.body.mounts) or 'none'}"
                        + (f", {static_cameras_path} {', '.join(self.stations)}" if self.stations else "")
                    )
