"""What a view shows, read and checked before a browser is asked to show it."""

from dataclasses import dataclass
from pathlib import Path

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import RecordingError, ViewError
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.view.correction import BodyFile
from bodycam_ros.view.motion import Motion, read_motion


@dataclass(frozen=True, eq=False)
class Sources:
    """What is looked at.

    Attributes:
        body_file: where the body comes from and is written to.
        body: as it was read.
        reference_map: the place.
        motion: of the body.
        solved: the bag that the motion is from.
        recording: the bag with images.
        cameras: of the body that have images.
    """

    body_file: BodyFile
    body: BodyModel
    reference_map: ReferenceMap
    motion: Motion
    solved: Path | None
    recording: Path | None
    cameras: tuple[str, ...]

    @classmethod
    def read(cls, solved: Path | None, map_path: Path, body_path: Path, recording: Path | None) -> "Sources":
        """Read them all.

        Raises:
            BodycamError: one of them is missing or damaged, or they do not fit each other.
        """
        if recording is not None and solved is None:
            raise ViewError(
                f"{recording}: without OUT nobody knows where the body was in these images; solve them first with "
                f"'bodycam replay {recording} --map {map_path} --body {body_path} -o OUT', then name OUT here too"
            )
        body_file = BodyFile(body_path)
        body = body_file.read()
        reference_map = ReferenceMap.load(map_path)
        motion = Motion.standing(body) if solved is None else read_motion(solved, body)
        cameras: tuple[str, ...] = ()
        if recording is not None:
            with open_recording(recording) as bag:
                cameras = tuple(camera for camera in body.mounts if camera in bag.cameras)
                if not cameras:
                    raise RecordingError(
                        f"{recording}: has none of the body's cameras; it has {', '.join(bag.cameras)}, the body "
                        f"{', '.join(body.mounts) or 'none'}"
                    )
        return cls(body_file, body, reference_map, motion, solved, recording, cameras)
