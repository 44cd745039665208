"""The package as a library: a loop over images, and states as they are solved.

from bodycam_ros import Body, Map, replay

for output in replay("walk.mcap", Map.load("map"), Body.load("body.yaml")):
print(output.state.stamp_ns, dict(zip(output.joint_names, output.positions)))
"""

from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import fields
from pathlib import Path

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.equipment import Equipment
from bodycam_ros.body_state import BodyOutput
from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import CameraImage, decode_grey
from bodycam_ros.camera.readout import Readout, best_known
from bodycam_ros.errors import BodyError
from bodycam_ros.inertial.imu_samples import ImuSamples
from bodycam_ros.kernels import prepare_kernels
from bodycam_ros.pipeline.camera import CameraPipeline, camera_turns
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.pipeline.skeleton import SkeletonPipeline
from bodycam_ros.recording.bag_reader import open_recording, read_imus
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.replay.map_updates import MapReplica, MapUpdate, MapUpdateSource
from bodycam_ros.tracking.image_rate import ImageRateLimit

__all__ = ["Body", "CameraImage", "CameraModel", "Map", "replay"]


class Body(BodyModel):
    """Segments, joints and camera mounts: ``Body.load("body.yaml")``."""

    @classmethod
    def load(cls, path: Path | str) -> "Body":
        """Read a body file: URDF if it is named so, else YAML.

        Raises:
            BodyError: the file is missing, or describes no body.
        """
        body = read_body(path)
        return cls(**{field.name: getattr(body, field.name) for field in fields(body) if field.init})


Map = ReferenceMap


def replay(
    images: Path | str | Iterable[CameraImage],
    reference_map: Map,
    body: BodyModel,
    cameras: Mapping[str, CameraModel] | None = None,
    equipment: Equipment | None = None,
    settings: PipelineSettings | None = None,
    live: bool = False,
    imus: Mapping[str, ImuSamples] | None = None,
) -> Iterator[BodyOutput]:
    """Solve a recording in this process, and yield states as they are solved, in order of time.

    They follow their images by some seconds, in which later images give the clocks and the poses of limbs that were
    blind.

    Args:
        images: a ros2 bag folder or .mcap file, or images in order of their stamps.
        reference_map: metric.
        body: which has been calibrated.
        cameras: models by name; of a bag its own.
        equipment: what the body rides, holds or stands on.
        settings: of all stages.
        live: states follow by ``estimator.output_delay`` frames alone, and may be as much less accurate.
        imus: camera -> samples of its inertial sensor; of a bag its own.

    Raises:
        RecordingError: there is no recording, or an image cannot be decoded.
        BodyError: the body carries none of the cameras that have models.
    """
    with ExitStack() as opened:
        readouts: Mapping[str, Readout | None] = body.readout_starts
        if isinstance(images, Path | str):
            recording = opened.enter_context(open_recording(Path(images)))
            body_cameras = [camera for camera in recording.cameras if camera in body.mounts]
            cameras = cameras or {camera: recording.camera_model(camera) for camera in body_cameras}
            readouts = {camera: best_known(recording.readout(camera), readouts.get(camera)) for camera in body_cameras}
            imus = imus or read_imus([Path(images)], body_cameras)
            images = recording.images(body_cameras)
        cameras, imus, settings = cameras or {}, imus or {}, settings or PipelineSettings()
        if not set(cameras) & set(body.mounts):
            raise BodyError(f"none of the cameras that have models is on the body ({', '.join(body.mounts)})")
        prepare_kernels()
        skeleton = SkeletonPipeline(body, cameras, settings, live, equipment=equipment, imus=imus)
        turns = camera_turns(body, imus) if settings.inertial.enabled else {}
        source = replica = None
        if settings.extension.enabled:
            sent: deque[MapUpdate] = deque()
            source = MapUpdateSource(reference_map, settings.extension.capacity, sent.append)
            replica = MapReplica(reference_map, settings.extension.capacity, sent.popleft)
        pipelines = {
            camera: CameraPipeline(
                model,
                reference_map,
                settings,
                readouts.get(camera),
                None if replica is None else replica.map,
                turns.get(camera),
            )
            for camera, model in cameras.items()
            if camera in body.mounts
        }
        limit = ImageRateLimit(settings.images.max_rate)
        for image in images:
            if image.camera not in pipelines or not limit.is_due(image.camera, image.stamp_ns):
                continue
            if source is not None and replica is not None:
                source.advance(image.recorded_ns or image.stamp_ns)
                replica.advance(image.recorded_ns or image.stamp_ns)
            _, matches, keyframe = pipelines[image.camera].process(decode_grey(image), image.stamp_ns)
            if source is not None and keyframe is not None:
                source.mapper.wait_for_turn(keyframe)
            yield from skeleton.add(matches)
        yield from skeleton.flush()
