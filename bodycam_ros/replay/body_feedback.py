"""What the body of one pass tells the registrars of the next: where lost cameras should be, and whom it doubts.

Live the same goes from the solver to the registration by topics.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel
from bodycam_ros.camera_pipeline import CameraPipeline
from bodycam_ros.pipeline import SkeletonPipeline
from bodycam_ros.pipeline_settings import PipelineSettings
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.solving.body_state import BodyOutput
from bodycam_ros.solving.expected_cameras import ExpectedCamera, expected_camera

_ALIKE_NS = 20_000_000
"""An instant this near to an image tells where its camera was."""


@dataclass(frozen=True)
class BodyHints:
    """What a body knows of its cameras that they did not know themselves.

    Attributes:
        expected: camera -> where the body has it while it is lost, in order of time.
        doubted_ns: camera -> stamps, by its own clock, of the first and last image of each stretch in which the body
            contradicted it, in order of time [ns].
    """

    expected: Mapping[str, tuple[ExpectedCamera, ...]] = field(default_factory=dict)
    doubted_ns: Mapping[str, tuple[tuple[int, int], ...]] = field(default_factory=dict)

    def of(self, camera: str) -> "HintsOfCamera":
        """Those of one camera."""
        return HintsOfCamera(self.expected.get(camera, ()), [first for first, _ in self.doubted_ns.get(camera, ())])


class HintsOfCamera:
    """Gives a registrar its hints in time.

    Args:
        expected: as of ``BodyHints``.
        doubted_ns: stamps of the first images that the body contradicted, in order of time [ns].
    """

    def __init__(self, expected: Iterable[ExpectedCamera], doubted_ns: Iterable[int]) -> None:
        self._expected, self._doubted_ns = list(reversed(list(expected))), list(reversed(list(doubted_ns)))

    def tell(self, pipeline: CameraPipeline, stamp_ns: int) -> None:
        """Whatever counts at an image [ns], which comes next."""
        while self._expected and self._expected[-1].stamp_ns <= stamp_ns + _ALIKE_NS // 2:
            pipeline.expect(self._expected.pop())
        # What is doubted is the pose of the image before: the first that the body refused has been registered by now.
        while self._doubted_ns and self._doubted_ns[-1] < stamp_ns - _ALIKE_NS // 2:
            pipeline.doubt(self._doubted_ns.pop())


class BodyFeedback:
    """Solves the body by what its cameras say in one pass.

    Args:
        body, cameras, settings: as of ``SkeletonPipeline``.
    """

    def __init__(self, body: BodyModel, cameras: Mapping[str, CameraModel], settings: PipelineSettings) -> None:
        self._body = body
        self._skeleton = SkeletonPipeline(body, cameras, settings)
        self._lost_ns: defaultdict[str, list[int]] = defaultdict(list)
        self._expected: defaultdict[str, list[ExpectedCamera]] = defaultdict(list)

    def hear(self, matches: LandmarkMatches) -> None:
        """One image of one camera, in order of time."""
        if matches.world_T_camera is None and matches.camera in self._body.mounts:
            self._lost_ns[matches.camera].append(matches.stamp_ns)
        self._look(self._skeleton.add(matches))

    def end(self) -> BodyHints:
        """The pass is over."""
        self._look(self._skeleton.flush())
        clocks = self._skeleton.instants.watch.timings
        doubted: defaultdict[str, list[tuple[int, int]]] = defaultdict(list)
        for refusal in sorted(self._skeleton.doubts, key=lambda refusal: refusal.since_ns):
            clock = clocks.get(refusal.camera)
            offset_ns = 0 if clock is None else clock.latest.offset_ns(refusal.since_ns)
            doubted[refusal.camera].append((refusal.since_ns + offset_ns, refusal.until_ns + offset_ns))
        return BodyHints(
            {camera: tuple(expected) for camera, expected in self._expected.items()},
            {camera: tuple(stamps) for camera, stamps in doubted.items()},
        )

    def _look(self, outputs: Iterable[BodyOutput]) -> None:
        """Keep where lost cameras were at the instants of images that they were lost in."""
        clocks = self._skeleton.instants.watch.timings
        for state in (output.state for output in outputs):
            for camera, lost_ns in self._lost_ns.items():
                offset_ns = clocks[camera].latest.offset_ns(state.stamp_ns) if camera in clocks else 0
                stamp_ns = state.stamp_ns + offset_ns
                while lost_ns and lost_ns[0] < stamp_ns - _ALIKE_NS:
                    lost_ns.pop(0)
                if lost_ns and lost_ns[0] <= stamp_ns + _ALIKE_NS:
                    mount = self._body.mounts[camera]
                    self._expected[camera].append(expected_camera(camera, mount, state, stamp_ns))
