"""Playing, and passing actions to one thread."""

import threading

import pytest

from bodycam_ros.view.inbox import Inbox
from bodycam_ros.view.panels import Playback


class Clock:
    """A clock that is set by hand."""

    def __init__(self) -> None:
        self.seconds = 100.0

    def __call__(self) -> float:
        return self.seconds


def test_time_goes_on_while_playing_at_its_speed_and_begins_again_at_the_end() -> None:
    clock = Clock()
    playback = Playback(2.0, clock)
    clock.seconds += 5.0
    assert playback.advance(0.5) == 0.5  # not playing yet
    playback.play()
    clock.seconds += 0.25
    assert playback.advance(0.5) == pytest.approx(0.75)
    playback.change_speed(0.5)
    clock.seconds += 0.5
    assert playback.advance(0.75) == pytest.approx(1.0)
    clock.seconds += 4.0
    assert playback.advance(1.0) == 0.0
    playback.pause()
    clock.seconds += 4.0
    assert playback.advance(0.3) == 0.3 and not playback.is_playing


def test_actions_are_done_in_order_and_only_the_last_of_a_name() -> None:
    inbox, done = Inbox(), []
    inbox.put(lambda: done.append("drag 1"), "drag")
    inbox.put(lambda: done.append("undo"))
    inbox.put(lambda: done.append("undo"))
    inbox.put(lambda: done.append("drag 2"), "drag")
    while action := inbox.take(0.0):
        action()
    assert done == ["undo", "undo", "drag 2"]


def test_who_waits_is_woken() -> None:
    inbox, done = Inbox(), []
    threading.Timer(0.05, lambda: inbox.put(lambda: done.append(True))).start()
    action = inbox.take(60.0)
    assert action is not None
    action()
    assert done == [True]


def test_playing_stops_at_the_end_unless_it_loops() -> None:
    clock = Clock()
    playback = Playback(2.0, clock)
    playback.loops = False
    playback.play()
    clock.seconds += 3.0
    assert playback.advance(0.5) == 2.0 and not playback.is_playing
