"""Steps of what is edited: undo, and a drag that is one step and does not depend on its way."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pytest

from bodycam_ros.geometry import Array, rigid
from bodycam_ros.viewer.editor import Editor
from bodycam_ros.viewer.server import LocalServer


@dataclass(frozen=True)
class Path:
    """All places that a part was moved to."""

    places: tuple[float, ...] = ()

    def moved_to(self, part: str, pose: Array) -> "Path":
        return Path((*self.places, float(pose[0, 3])))


def at(x: float) -> Array:
    return rigid(np.eye(3), np.array([x, 0.0, 0.0]))


@pytest.fixture
def editor() -> Iterator[Editor]:
    server = LocalServer(0, "test")
    editor = Editor(
        server, "Edit", "", {"nothing": None, "part": "part"}, Path(), "file",
        select=lambda part: None, changed=lambda: None, write=lambda: None,
    )  # fmt: skip
    editor.show("part", "/world", np.eye(4))
    yield editor
    server.stop()


def test_undo_goes_back_step_by_step(editor: Editor) -> None:
    editor.move(at(1.0))
    first = editor.edited
    editor.move(at(2.0))
    editor.change(Path((3.0,)))
    editor.undo()
    assert editor.edited == Path((1.0, 2.0))
    editor.undo()
    assert editor.edited is first
    for _ in range(2):
        editor.undo()
        assert editor.edited == Path()  # no step is left


def test_a_drag_is_one_step_and_does_not_depend_on_its_way(editor: Editor) -> None:
    editor.move(at(1.0))
    editor.move(at(1.1))
    for x in (1.2, 1.7, 1.5):
        editor.move(at(x), continues=True)
    assert editor.edited == Path((1.0, 1.5))
    editor.undo()
    assert editor.edited == Path((1.0,))


def test_what_was_written_cannot_be_undone(editor: Editor) -> None:
    editor.move(at(1.0))
    editor.restart(Path((5.0,)))
    editor.undo()
    assert editor.edited == Path((5.0,))


def test_nothing_is_moved_while_nothing_is_chosen(editor: Editor) -> None:
    editor.show("nothing")
    editor.move(at(1.0))
    assert editor.edited == Path()


def test_a_drag_goes_on_where_what_it_moved_was_written_meanwhile(editor: Editor) -> None:
    editor.move(at(1.0))
    editor.restart(Path())
    editor.move(at(2.0), continues=True)
    assert editor.edited == Path((2.0,))


def test_undo_is_dead_while_there_is_nothing_to_undo(editor: Editor) -> None:
    assert editor._undo.disabled
    editor.move(at(1.0))
    assert not editor._undo.disabled
    editor.undo()
    assert editor._undo.disabled
    editor.move(at(2.0))
    editor.restart(Path((5.0,)))
    assert editor._undo.disabled
