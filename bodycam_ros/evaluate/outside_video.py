"""What one static camera saw, as a video: the solved body's surface, contour and forces painted over it."""

from pathlib import Path

from threadpoolctl import threadpool_limits

from bodycam_ros.errors import StationError
from bodycam_ros.evaluate.outside_scene import OutsideScene
from bodycam_ros.mapping.progress import Progress
from bodycam_ros.outside.contour_painting import Window, paint_contour
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.shown import shown
from bodycam_ros.solved.solved_recording import SolvedRecording
from bodycam_ros.video.video_writer import video_writer

_SHARP_PX = 720
"""Pictures that are less high are magnified."""


def check_station(scene: OutsideScene, station: str) -> None:
    """Refuse a name that no static camera of the recording has.

    Raises:
        StationError: so it is.
    """
    if station not in scene.stations:
        raise StationError(
            f"--video {shown(station)}: is no static camera that the recording has images of; there are "
            f"{', '.join(scene.stations)}"
        )


def draw_outside_video(
    scene: OutsideScene, solved: SolvedRecording, recording: Path, station: str, path: Path, progress: Progress
) -> None:
    """Write the video as MP4: every image of a station while the body is solved, as long after each other as they were.

    Colours are learned as the tracker does, image by image.

    Raises:
        RecordingError: not a recording, or an image that cannot be decoded.
        StationError: there is no image of it.
        OutputError: the video cannot be written.
    """
    camera = scene.stations[station].camera
    window = Window(0, 0, camera.width, camera.height, -(-_SHARP_PX // camera.height))
    with (
        open_recording(recording) as images,
        progress.step(path.name, images.image_count(station)) as advance,
        video_writer(path, 1e9 / solved.frame_ns) as write,
        threadpool_limits(1, user_api="blas"),  # whose threads would wait for those that decode and compress
    ):
        is_empty = True
        for image in images.images([station]):
            advance()
            if not solved.stamps_ns[0] <= image.stamp_ns <= solved.stamps_ns[-1]:
                continue
            pixels, poses = scene.decoded(image), scene.poses_at(image.stamp_ns)
            scene.learn(station, pixels, poses)
            painted = paint_contour(pixels, scene.contour(station, pixels, poses), scene.colours, window)
            write(1e-9 * (image.stamp_ns - int(solved.stamps_ns[0])), painted)
            is_empty = False
        if is_empty:
            raise StationError(f"{recording}: has no image of {station} from the time that {solved.path} has")
