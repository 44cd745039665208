"""The timeline's rows: spans at their times, in their colours; names are text."""

from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from helpers.known_walk import walking_body

from bodycam_ros.results.colours import LEFT
from bodycam_ros.viewer.contacts import Contact
from bodycam_ros.viewer.motion import Motion
from bodycam_ros.viewer.scene import LOST, REGISTERED
from bodycam_ros.viewer.timeline import SOME_LOST, Row, rows_html, spans_of, timeline_rows

STEP_NS = 100_000_000


def motion_at(states: list[int]) -> Motion:
    """A body that stands, with states at some tenths of a second."""
    standing = Motion.standing(walking_body())
    count = len(states)
    return replace(
        standing,
        stamps_ns=STEP_NS * np.array(states, np.int64),
        world_T_root=np.repeat(standing.world_T_root, count, axis=0),
        angles=np.repeat(standing.angles, count, axis=0),
    )


def test_a_row_of_cameras_says_whether_all_some_or_none_are_registered() -> None:
    motion = motion_at([0, 1, 2, 3])
    poses = np.tile(np.eye(4), (4, 1, 1))
    stamps = motion.stamps_ns
    motion = replace(motion, registered={"waist": (stamps[:2], poses[:2]), "shin": (stamps[[0, 2]], poses[:2])})
    (row,) = timeline_rows(motion)
    assert row.colours.tolist() == [REGISTERED, SOME_LOST, SOME_LOST, LOST]


def test_a_span_ends_between_states_and_none_bridges_a_gap_of_time() -> None:
    motion = motion_at([0, 1, 2, 3, 8, 9, 10])
    spans = spans_of(Row("x", np.array(["#111111", "#111111", "", "#222222", "#222222", "#222222", "#222222"])), motion)
    ends = [(start, end) for start, end, _ in spans]
    assert np.allclose(ends, [(0.0, 0.15), (0.25, 0.375), (0.725, 1.0)])
    assert [colour for *_, colour in spans] == ["#111111", "#222222", "#222222"]


def test_a_long_recording_has_a_bounded_row() -> None:
    motion = motion_at(list(range(20_000)))
    flickers = Row("x", np.where(np.arange(20_000) % 3 == 0, "#111111", ""))
    assert 0 < len(spans_of(flickers, motion)) <= 800


def test_what_lasts_for_one_state_is_seen_in_a_long_recording() -> None:
    motion = motion_at(list(range(20_000)))
    colours = np.full(20_000, REGISTERED)
    colours[[5001, 9001, 9002]] = LOST, SOME_LOST, LOST
    touches = np.full(20_000, "", dtype="<U7")
    touches[7001] = LEFT
    shown = [[colour for *_, colour in spans_of(Row("x", each), motion)] for each in (colours, touches)]
    assert shown == [[REGISTERED, LOST, REGISTERED, LOST, REGISTERED], [LEFT]]


@pytest.mark.parametrize("name", ["<script>window.ran=1</script>", '"><img src=x onerror="window.ran=1">', "a & {b}"])
def test_a_name_is_text(name: str) -> None:
    motion = replace(motion_at([0, 1, 2]), contacts=(Contact(name, np.ones((3, 1), bool)),))
    tags: list[str] = []
    texts: list[str] = []
    parser = HTMLParser()
    parser.handle_starttag = lambda tag, attrs: tags.append(tag)  # type: ignore[method-assign]
    parser.handle_startendtag = lambda tag, attrs: tags.append(tag)  # type: ignore[method-assign]
    parser.handle_data = lambda data: texts.append(data)  # type: ignore[method-assign]
    parser.feed(rows_html(timeline_rows(motion), motion))
    assert set(tags) == {"div", "span", "svg", "rect"}
    assert "".join(texts) == name.replace("_", " ")
