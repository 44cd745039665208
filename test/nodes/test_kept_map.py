"""A registration whose map grows: after a crash it goes on from what was saved.

Beside it one that keeps nothing.
"""

from pathlib import Path
from typing import Any

import numpy as np
from helpers.known_keyframes import K, body_camera, descriptors_of, place, small_map, tracks, unknown_points

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import inverse, log_se3
from bodycam_ros.graph.declared_graph import GraphNode
from bodycam_ros.messages.tracks import landmark_matches, tracks_message
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.track_frame import TrackFrame

CAMERA = body_camera()
UNKNOWN = unknown_points(100)
_START_S, _SOON_S = 60.0, 60.0
_PART = "registration: extended map"


class Tracker:
    """Says what one camera sees, and hears what the registration makes of it."""

    def __init__(self, graph: Any, camera: CameraModel = CAMERA) -> None:
        from bodycam_ros.nodes.parameters import node_messages

        self._graph = graph
        self._make = node_messages()
        self._camera = camera
        graph.listen({f"/{camera.name}/landmarks": "bodycam_msgs/msg/LandmarkMatches"})
        graph.listen({"/diagnostics": "diagnostic_msgs/msg/DiagnosticArray"})
        self._tracks = graph.publisher(f"/{camera.name}/tracks", "bodycam_msgs/msg/FeatureTracks")
        self._infos = graph.publisher(f"/{camera.name}/camera_info", "sensor_msgs/msg/CameraInfo")
        self._said = (self._tracks, self._infos)
        self._number = 0

    def readers(self) -> int:
        """Least number of readers of its topics; one that was killed counts for some seconds more."""
        return min(each.get_subscription_count() for each in self._said)

    def inform(self, readers_before: int = 0) -> None:
        self._graph.until(lambda: self.readers() > readers_before, _START_S, "the registration listens")
        info = self._make("sensor_msgs/msg/CameraInfo", width=CAMERA.width, height=CAMERA.height)
        info.distortion_model = "equidistant"
        info.d = [0.0] * 4
        info.k = [float(value) for value in K]
        self._infos.publish(info)

    def say(self, *points: np.ndarray, descriptors: np.ndarray, anew: bool = False) -> LandmarkMatches:
        """The next image; anew: of a tracker that has just started."""
        frame = tracks(
            self._camera,
            self._number,
            np.concatenate(points),
            descriptors,
            self._number if anew else 0,
            1000 * self._number,
        )
        self._number += 1
        return self._answer(frame)

    def _answer(self, frame: TrackFrame) -> LandmarkMatches:
        heard = self._graph.heard[f"/{self._camera.name}/landmarks"]
        before = len(heard)
        self._tracks.publish(tracks_message(self._make, frame))
        self._graph.until(lambda: len(heard) > before, _SOON_S, "the image is registered")
        return landmark_matches(self._graph.messages(f"/{self._camera.name}/landmarks", -1)[0], self._camera.name)

    def see_all(self) -> LandmarkMatches:
        reference_map = small_map()
        both = np.concatenate([reference_map.descriptors, descriptors_of(len(UNKNOWN), 7)])
        return self.say(reference_map.points_world, UNKNOWN, descriptors=both)

    def see_unknown(self) -> LandmarkMatches:
        """Nothing that the photographs show."""
        return self.say(UNKNOWN, descriptors=descriptors_of(len(UNKNOWN), 7), anew=True)

    def is_where_it_is(self, matches: LandmarkMatches) -> bool:
        if matches.world_T_camera is None:
            return False
        away = log_se3(inverse(place(self._number - 1)) @ matches.world_T_camera)
        return bool(np.linalg.norm(away[3:]) < 5e-3)


def test_what_has_grown_outlives_a_crash(graph: Any, tmp_path: Path) -> None:
    small_map().save(tmp_path / "map")
    given = {"map": str(tmp_path / "map"), "cameras": [CAMERA.name], "grown_map": str(tmp_path / "grown")}
    kept = tmp_path / "grown/registration"
    tracker = Tracker(graph)
    nowhere = {"map": str(tmp_path / "map"), "cameras": ["foot"]}
    first, _ = graph.run(
        GraphNode("registration", "registration", {**given, "save_interval": 1.0}),
        GraphNode("registration", "keeps_nothing", nowhere),
    )
    tracker.inform()

    def says(name: str) -> str:
        return str(graph.diagnostics(_PART).get(name, ""))

    for _ in range(6):
        assert tracker.is_where_it_is(tracker.see_all())
    graph.until(lambda: says("landmarks added") == "100", _SOON_S, "the map grows")
    graph.until(lambda: says("changes not saved") == "0", _SOON_S, "it is saved without being asked")
    readers = tracker.readers()
    first.crash()
    assert ReferenceMap.load(kept).grown == 100

    graph.heard["/diagnostics"].clear()
    (second,) = graph.run(GraphNode("registration", "registration", {**given, "save_interval": 600.0}))
    graph.until(lambda: says("landmarks added") == "100", _START_S, "what had grown is there")
    graph.until(lambda: tracker.readers() >= readers, _START_S, "the registration listens")
    tracker.inform()
    assert tracker.is_where_it_is(tracker.see_unknown()), "registered by what had grown before the crash"

    other_half = unknown_points(30, seed=9)
    descriptors = np.concatenate([small_map().descriptors, descriptors_of(len(other_half), 9)])
    for _ in range(5):
        tracker.say(small_map().points_world, other_half, descriptors=descriptors)
    graph.until(lambda: int(says("landmarks added")) > 120, _SOON_S, "the map grows on")

    assert second.end() == 0
    assert ReferenceMap.load(kept).grown > 120, "it is saved before the node goes"
