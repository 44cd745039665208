"""What cameras do to a graph: clocks that jump, stamps that are none, camera_info in every way a driver offers it."""

from pathlib import Path
from typing import Any

import numpy as np
from helpers.driven_camera import DrivenCamera, stamps
from helpers.two_cameras import write_map

from bodycam_ros.graph.declared_graph import GraphNode
from bodycam_ros.messages.factory import stamp_ns

HOUR_NS = 3_600_000_000_000
_START_S, _SOON_S = 60.0, 60.0
_WARN, _ERROR = 1, 2
_TRACKS = {"/left/tracks": "bodycam_msgs/msg/FeatureTracks"}
_DIAGNOSTICS = {"/diagnostics": "diagnostic_msgs/msg/DiagnosticArray"}


def test_stamps_that_stray_are_left_out_and_a_time_that_begins_anew_is_followed(graph: Any) -> None:
    from bodycam_ros.nodes.parameters import reliable

    camera = DrivenCamera(graph, "left", reliable(500), reliable(10))
    graph.listen(_TRACKS | _DIAGNOSTICS)
    (tracker,) = graph.run(camera.tracker)
    graph.until(camera.images.get_subscription_count, _START_S, "the tracker reads")

    def reports(text: str = "") -> list[dict[str, Any]]:
        return [r for r in graph.all_diagnostics("tracker_left: camera left") if text in r["text"]]

    graph.until(lambda: reports("no image on left/image_raw, though"), _SOON_S, "what is missing is told")
    assert reports("no image")[-1]["level"] == _ERROR
    camera.show([0] * 5)
    graph.until(lambda: reports()[-1].get("images without a stamp") == "5", _SOON_S, "zeros are named")
    camera.inform()
    first = stamps(0, 30)
    # An hour ahead, and then on as before; then a few that are older than what came before.
    camera.show([*first[:20], first[20] + HOUR_NS, *first[20:], first[3], first[2]])
    # The bag is played again.
    again = stamps(0, 25)
    camera.show(again)
    graph.until(lambda: len(graph.heard["/left/tracks"]) >= len(first + again), _SOON_S, "all are tracked")
    tracks = graph.messages("/left/tracks")
    assert [stamp_ns(message.header.stamp) for message in tracks] == first + again
    begun = [number for number, message in enumerate(tracks) if stamp_ns(message.previous_stamp) == 0]
    assert begun == [0, len(first)] and all(tracks[number].keyframe for number in begun)

    counted = {"images without a stamp": "5", "images out of time": "3", "restarts": "1"}
    graph.until(lambda: counted.items() <= reports()[-1].items(), _SOON_S, "all of that is counted")

    later = iter(stamps(25, 1000))

    def has_warned() -> bool:
        if camera.is_due():
            camera.show([next(later), again[0], next(later)])
        return any(report["level"] == _WARN for report in reports("dropped"))

    graph.until(has_warned, _SOON_S, "what is left out is a warning")

    def is_well() -> bool:
        if camera.is_due():
            camera.show([next(later)])
        return bool(reports()[-1]["text"] == "tracking")

    graph.until(is_well, _SOON_S, "a warning ends when its cause has ended")
    assert tracker.end() == 0


def test_camera_info_is_heard_however_it_comes(graph: Any) -> None:
    from bodycam_ros.nodes.parameters import best_effort, latched, reliable

    best, early, late = (
        DrivenCamera(graph, name, quality, info_quality)
        for name, quality, info_quality in (
            ("best", best_effort(100), best_effort(10)),
            ("early", reliable(100), latched()),
            ("late", reliable(100), reliable(1)),
        )
    )
    cameras = (best, early, late)
    graph.listen({f"/{camera.name}/tracks": "bodycam_msgs/msg/FeatureTracks" for camera in cameras})
    graph.listen(_DIAGNOSTICS)
    early.inform()
    graph.run(best.tracker, early.tracker, late.tracker)
    graph.until(lambda: all(c.images.get_subscription_count() for c in cameras), _START_S, "the trackers read")

    images = iter(stamps(0, 1000))

    def are_tracked(*names: str) -> bool:
        if best.is_due():
            best.inform()
            stamp = next(images)
            for camera in cameras:
                camera.show([stamp])
        return all(graph.heard[f"/{name}/tracks"] for name in names)

    graph.until(lambda: are_tracked("best", "early"), _SOON_S, "best effort and latched camera_info are heard")
    assert not graph.heard["/late/tracks"]
    late.inform()
    graph.until(lambda: are_tracked("late"), _SOON_S, "a camera_info that comes long after the images is heard")

    # Another lens: the tracks begin anew with its model.
    count = len(graph.heard["/late/tracks"])
    late.inform(focal_px=35.0)
    graph.until(lambda: are_tracked("late"), _SOON_S, "a change is noticed")
    graph.until(
        lambda: (
            are_tracked("late")
            and any(stamp_ns(message.previous_stamp) == 0 for message in graph.messages("/late/tracks")[count:])
        ),
        _SOON_S,
        "the tracks begin anew",
    )
    changed = "camera_info changed"
    graph.until(lambda: graph.diagnostics("tracker_late: camera late").get(changed) == "1", _SOON_S, "it is named")
    assert graph.diagnostics("tracker_best: camera best")[changed] == "0", "the same again is no change"
    assert set(graph.end().values()) == {0}, graph.report()


def test_a_camera_with_an_unusable_camera_info_is_left_out_and_taken_back(graph: Any) -> None:
    """An uncalibrated driver sends an empty one; it ended the tracker, and the whole graph."""
    from bodycam_ros.nodes.parameters import latched, message_class, reliable

    camera = DrivenCamera(graph, "left", reliable(100), latched())
    graph.listen(_TRACKS | _DIAGNOSTICS)
    empty = graph.publisher("/left/camera_info", "sensor_msgs/msg/CameraInfo", latched())
    empty.publish(message_class("sensor_msgs/msg/CameraInfo")())
    (tracker,) = graph.run(camera.tracker)
    images = iter(stamps(0, 1000))

    def report() -> dict[str, Any]:
        if camera.is_due():
            camera.show([next(images)])
        return dict(graph.diagnostics("tracker_left: camera left") or {"text": "", "level": 0})

    graph.until(lambda: "its camera_info is unusable" in report()["text"], _SOON_S, "it is told")
    assert report()["level"] == _ERROR and not graph.heard["/left/tracks"]
    camera.inform()
    graph.until(lambda: report()["text"] == "tracking", _SOON_S, "it is taken back")
    assert not tracker.is_over and tracker.end() == 0


def test_a_registration_that_comes_into_the_middle_asks_for_a_keyframe(graph: Any, tmp_path: Path) -> None:
    from bodycam_ros.nodes.parameters import latched, reliable

    camera = DrivenCamera(graph, "left", reliable(100), latched())
    graph.listen(_TRACKS | {"/left/landmarks": "bodycam_msgs/msg/LandmarkMatches"})
    camera.inform()
    seldom = GraphNode("tracker", "tracker_left", {**camera.tracker.parameters, "tracker.keyframe_interval": 300})
    graph.run(seldom)
    images = iter(stamps(0, 2000))

    def count(topic: str) -> int:
        if camera.is_due():
            camera.show([next(images)])
        return len(graph.heard[f"/left/{topic}"])

    def keyframes() -> list[int]:
        return [number for number, message in enumerate(graph.messages("/left/tracks")) if message.keyframe]

    graph.until(lambda: count("tracks") >= 20, _START_S, "the tracker tracks")
    assert keyframes() == [0], "an image that stands still needs no other"
    shared = {"map": str(write_map(tmp_path / "map")), "cameras": ["left"]}
    graph.run(GraphNode("registration", "registration", shared))
    graph.until(lambda: count("landmarks") >= 1, _START_S, "the registration hears")
    came = len(graph.heard["/left/tracks"])
    graph.until(lambda: count("tracks") and len(keyframes()) > 1, _SOON_S, "it gets a keyframe")
    assert keyframes()[1] < came + 20, (keyframes(), came)
    goes_on = len(graph.heard["/left/landmarks"]) + 30
    graph.until(lambda: count("landmarks") >= goes_on, _SOON_S, "it goes on")
    gaps = np.diff(keyframes()[2:])
    assert np.all(gaps > 4), "it does not go on asking, but a lost camera is described again now and then"
    assert set(graph.end().values()) == {0}, graph.report()
