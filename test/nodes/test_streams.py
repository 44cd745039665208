"""What cameras do to a graph: clocks that jump, stamps that are none, camera_info in every way a driver offers it."""

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from driven_camera import PERIOD_S, DrivenCamera, stamps
from tiny_bag import FRAME_NS
from two_cameras import write_map

from bodycam_ros.messages.header import stamp_ns
from bodycam_ros.nodes.graph import NodeProcess

pytestmark = pytest.mark.long

HOUR_NS = 3_600_000_000_000
_START_S, _SOON_S = 60.0, 20.0
_WARN, _ERROR = 1, 2
_TRACKS = {"/left/tracks": "bodycam_msgs/msg/FeatureTracks"}
_DIAGNOSTICS = {"/diagnostics": "diagnostic_msgs/msg/DiagnosticArray"}


def test_stamps_that_stray_are_left_out_and_a_time_that_begins_anew_is_followed(graph: Any) -> None:
    from bodycam_ros.nodes.qos import reliable

    camera = DrivenCamera(graph, "left", reliable(500), reliable(10))
    graph.listen(_TRACKS | _DIAGNOSTICS)
    (tracker,) = graph.start(camera.tracker)
    graph.until(camera.images.get_subscription_count, _START_S, "the tracker reads")

    def reports(text: str = "") -> list[dict[str, Any]]:
        return [r for r in graph.all_diagnostics("tracker_left: camera left") if text in r["text"]]

    graph.until(lambda: reports("and no left/camera_info"), _SOON_S, "what is missing is told")
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

    counted = {"images without a stamp": "5", "images out of time": "3", "times begun anew": "1"}
    graph.until(lambda: counted.items() <= reports()[-1].items(), _SOON_S, "all of that is counted")

    later = iter(stamps(25, 1000))

    def has_warned() -> bool:
        if camera.is_due():
            camera.show([next(later), again[0], next(later)])
        return any(report["level"] == _WARN for report in reports("left out"))

    graph.until(has_warned, _SOON_S, "what is left out is a warning")

    def is_well() -> bool:
        if camera.is_due():
            camera.show([next(later)])
        return bool(reports()[-1]["text"] == "tracking")

    graph.until(is_well, _SOON_S, "a warning ends when its cause has ended")
    assert tracker.end() == 0, tracker.printed
    assert "Traceback" not in tracker.printed


def test_camera_info_is_heard_however_it_comes(graph: Any) -> None:
    from bodycam_ros.nodes.qos import best_effort, latched, reliable

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
    # A clock that nobody publishes keeps no timer from running.
    clockless = NodeProcess("tracker", "tracker_best", {**best.tracker.parameters, "use_sim_time": True})
    started = graph.start(clockless, early.tracker, late.tracker)
    graph.until(lambda: all(c.images.get_subscription_count() for c in cameras), _START_S, "the trackers read")
    graph.until(lambda: graph.diagnostics("tracker_best: clock"), _SOON_S, "the missing clock is told")
    assert "nobody publishes /clock" in graph.diagnostics("tracker_best: clock")["text"]

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
    graph.until(lambda: are_tracked("late") and "has changed" in started[2].printed, _SOON_S, "a change is noticed")
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


def test_a_registration_that_comes_into_the_middle_asks_for_a_keyframe(graph: Any, tmp_path: Path) -> None:
    from bodycam_ros.nodes.qos import latched, reliable

    camera = DrivenCamera(graph, "left", reliable(100), latched())
    graph.listen(_TRACKS | {"/left/landmarks": "bodycam_msgs/msg/LandmarkMatches"})
    camera.inform()
    seldom = NodeProcess("tracker", "tracker_left", {**camera.tracker.parameters, "tracker.keyframe_interval": 300})
    graph.start(seldom)
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
    (registration,) = graph.start(NodeProcess("registration", "registration", shared))
    graph.until(lambda: count("landmarks") >= 1, _START_S, "the registration hears")
    came = len(graph.heard["/left/tracks"])
    graph.until(lambda: count("tracks") and len(keyframes()) > 1, _SOON_S, "it gets a keyframe")
    assert keyframes()[1] < came + 20, (keyframes(), came)
    goes_on = len(graph.heard["/left/landmarks"]) + 30
    graph.until(lambda: count("landmarks") >= goes_on, _SOON_S, "it goes on")
    gaps = np.diff(keyframes()[2:])
    assert np.all(gaps > 4), "it does not go on asking, but a lost camera is described again now and then"
    assert set(graph.end().values()) == {0} and "Traceback" not in registration.printed, graph.report()


def test_a_machine_that_is_too_slow_leaves_out_every_second_image_and_comes_back(graph: Any) -> None:
    """The registration is played by the test, so that how slow it is does not depend on the machine."""
    from bodycam_ros.nodes.message_classes import node_messages
    from bodycam_ros.nodes.qos import latched, reliable

    make, camera = node_messages(), DrivenCamera(graph, "left", reliable(100), latched())
    answers = graph.publisher("/left/landmarks", "bodycam_msgs/msg/LandmarkMatches", reliable(10))
    graph.listen(_TRACKS | _DIAGNOSTICS)
    camera.inform()
    adaptive = {"most_ahead": 1, "longest_wait": 0.5, "recovery": 1.5, "image_queue": 1000}
    graph.start(NodeProcess("tracker", "tracker_left", {**camera.tracker.parameters, **adaptive}))
    graph.until(
        lambda: camera.images.get_subscription_count() and answers.get_subscription_count(), _START_S, "it reads"
    )
    images = iter(stamps(0, 100_000))
    answered, due_s = 0, 0.0

    def go_on(pause_s: float) -> None:
        """An image where it is due, and an answer so long after the one before."""
        nonlocal answered, due_s
        if camera.is_due():
            camera.show([next(images)])
        if answered < len(graph.heard["/left/tracks"]) and time.monotonic() > due_s:
            (frame,) = graph.messages("/left/tracks", answered)[:1]
            answer = make("bodycam_msgs/msg/LandmarkMatches", header=frame.header, registered=False)
            answers.publish(answer)
            answered, due_s = answered + 1, time.monotonic() + pause_s

    def says(text: str, pause_s: float) -> bool:
        go_on(pause_s)
        return bool(text in graph.diagnostics("tracker_left: camera left").get("text", ""))

    def tracked() -> list[int]:
        return [stamp_ns(message.header.stamp) for message in graph.messages("/left/tracks")]

    graph.until(lambda: says("tracking", 0.0) and answered > 20, _SOON_S, "it keeps up")
    assert np.all(np.diff(tracked()) == FRAME_NS), "nothing is left out where it keeps up"
    # A quarter slower than the images come, so that half of them are little.
    slow = 1.25 * PERIOD_S
    graph.until(lambda: says("every second image left out", slow), _SOON_S, "it leaves images out, and says so")
    assert graph.diagnostics("tracker_left: camera left")["level"] == _WARN
    first = len(tracked())
    graph.until(lambda: says("", slow) and len(tracked()) > first + 10, _SOON_S, "it goes on")
    apart = np.diff(tracked()[first : first + 10])
    assert np.mean(apart == 2 * FRAME_NS) > 0.8 and apart.max() <= 3 * FRAME_NS
    graph.until(lambda: says("tracking", 0.0), _SOON_S, "it comes back")
    first = len(tracked()) + 5
    graph.until(lambda: says("", 0.0) and len(tracked()) > first + 10, _SOON_S, "it goes on")
    assert np.all(np.diff(tracked()[first:]) == FRAME_NS)
    assert "images dropped" not in graph.diagnostics("tracker_left: camera left")
    assert set(graph.end().values()) == {0}, graph.report()
