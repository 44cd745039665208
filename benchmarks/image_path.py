"""The files that an image passes on its way to a joint state, by a trace at run time: python -m benchmarks.image_path.

The image is an ordinary one: its camera is found by the photographs of the map, and it completes the state of a
state. Functions of the package are noted when they are called, from the image's bytes to the state that it gives.
"""

import argparse
import sys
from pathlib import Path
from types import FrameType

import bodycam_ros
from bodycam_ros import Body, Map
from bodycam_ros.camera.camera_image import CameraImage, decode_grey
from bodycam_ros.kernels import load_kernels
from bodycam_ros.pipeline.camera_front import CameraFront, camera_fronts
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.pipeline.skeleton import SkeletonPipeline
from bodycam_ros.recording.bag_reader import open_recording

_WARM = 500  # images before the one that is traced
_PACKAGE = Path(bodycam_ros.__file__).parent


def image_path(bag: Path, reference_map: Map, body: Body) -> dict[str, list[str]]:
    """File of the package -> its functions, in the order of their first calls, for one image that gives a state."""
    with open_recording(bag) as recording:
        cameras = {name: recording.camera_model(name) for name in recording.cameras if name in body.mounts}
        settings = PipelineSettings()
        fronts = camera_fronts(cameras, reference_map, settings, readouts={}, turns={})
        skeleton = SkeletonPipeline(body, cameras, settings, live=True)
        for number, image in enumerate(recording.images(cameras)):
            if number < _WARM:
                _solve(image, fronts[image.camera], skeleton)
                continue
            path, states = _traced(image, fronts[image.camera], skeleton)
            if states == 1 and "tracking/keypoints.py" not in path:
                return path
    raise RuntimeError(f"{bag}: no ordinary image completes a state")


def _solve(image: CameraImage, front: CameraFront, skeleton: SkeletonPipeline) -> int:
    _, matches, _ = front.process(decode_grey(image), image.stamp_ns)
    return len(skeleton.add(matches))


def _traced(image: CameraImage, front: CameraFront, skeleton: SkeletonPipeline) -> tuple[dict[str, list[str]], int]:
    path: dict[str, list[str]] = {}

    def note(frame: FrameType, event: str, _: object) -> None:
        file = Path(frame.f_code.co_filename)
        if event == "call" and file.is_relative_to(_PACKAGE):
            functions = path.setdefault(str(file.relative_to(_PACKAGE)), [])
            if frame.f_code.co_qualname not in functions:
                functions.append(frame.f_code.co_qualname)

    sys.setprofile(note)
    try:
        states = _solve(image, front, skeleton)
    finally:
        sys.setprofile(None)
    return path, states


def main() -> None:
    """Print the path, a line a file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bag", type=Path, default=Path("bags/sample/bag"))
    parser.add_argument("--map", type=Path, default=Path("bags/map"))
    parser.add_argument("--body", type=Path, default=Path("bags/body.yaml"))
    arguments = parser.parse_args()
    load_kernels()
    path = image_path(arguments.bag, Map.load(arguments.map), Body.load(arguments.body))
    for file, functions in path.items():
        print(f"{file:42} {', '.join(functions)}")
    print(f"{len(path)} files, {sum(map(len, path.values()))} functions")


if __name__ == "__main__":
    main()
