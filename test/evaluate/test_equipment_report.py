"""What evaluate says of a body that was solved with equipment."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.known_walk import FRAME_NS, FRAMES, Walk
from helpers.naming import naming
from helpers.ride_with_open_joints import OFF, UNPLACED, write_held
from matplotlib.figure import Figure

from bodycam_ros.cli.main import main
from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.equipment import draw_equipment
from bodycam_ros.evaluate.evaluation import Evaluation, evaluate
from bodycam_ros.evaluate.summary_picture import draw_figures
from bodycam_ros.messages.body import EQUIPMENT
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_writer import write_recording
from bodycam_ros.results.colours import CENTRE, LEFT
from bodycam_ros.results.colours import EQUIPMENT as EQUIPMENT_COLOUR
from bodycam_ros.results.solved_recording import read_solved


@pytest.fixture(scope="module")
def bag(ride: Walk, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_held(ride, tmp_path_factory.mktemp("held") / "out")


def test_the_command_tells_of_every_attachment_and_length(
    bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["evaluate", str(bag), "-o", str(tmp_path / "report")]) == 0
    told = capsys.readouterr().out
    for text in (
        "equipment bicycle",
        "pedal_left",
        "85.0%",
        "known from 0.10 s",
        "3000.0",
        "crank_x",
        "attachment bar is 3 m from the body",
    ):
        assert text in told
    figures = json.loads((tmp_path / "report/summary.json").read_text())["equipment"]
    assert figures["placed"] == 1.0 - len(UNPLACED) / FRAMES
    pedal, bar = figures["attachments"]["pedal_left"], figures["attachments"]["bar"]
    held = [frame for frame in range(FRAMES) if frame not in OFF and frame not in UNPLACED]
    assert pedal["held"] == pytest.approx(len(held) / FRAMES)
    assert pedal["deviation_mm"]["mean"] == pytest.approx(np.mean([1.0 + 0.01 * frame for frame in held]))
    assert pedal["deviation_mm"]["max"] == pytest.approx(1.0 + 0.01 * held[-1])
    assert pedal["apart_mm"]["median"] == pytest.approx(40.0)
    frame_s = 1e-9 * FRAME_NS
    np.testing.assert_allclose(pedal["let_go_s"], [[frame_s * OFF[0], frame_s * OFF[-1]]], atol=1e-6)
    assert figures["placed_from_s"] == pytest.approx(frame_s * len(UNPLACED), abs=1e-6)
    assert (bar["held"], bar["deviation_mm"]["mean"]) == (0.0, None)
    assert figures["lengths"]["crank_x"] == {
        "value_mm": pytest.approx(170.0 - 0.1 * (FRAMES - 1)),
        "sigma_mm": pytest.approx(20.0 / FRAMES),
    }


def test_the_picture_shows_each_attachment_over_time_and_what_is_let_go_faint(bag: Path) -> None:
    solved = read_solved(bag)
    assert solved.equipment is not None
    axes = Figure().add_subplot()
    draw_equipment(axes, solved, solved.equipment)
    held, let_go, never, bar = axes.get_lines()
    assert [line.get_alpha() for line in (held, let_go, never, bar)] == [1.0, 0.45, 1.0, 0.45]
    seconds, distance = np.asarray(held.get_data(), dtype=float)
    assert np.nanmax(distance) == pytest.approx(40.0), "the lines meet where the foot comes back"
    inside = (seconds > 1e-9 * FRAME_NS * OFF[0]) & (seconds < 1e-9 * FRAME_NS * (OFF[-1] - 1))
    assert np.isnan(distance[inside]).all()
    assert np.isnan(np.asarray(never.get_ydata(), dtype=float)).all()
    assert np.nanmin(np.asarray(bar.get_ydata(), dtype=float)) == pytest.approx(3000.0)
    assert held.get_color() == LEFT and bar.get_color() == CENTRE


def test_the_axis_begins_at_what_was_measured(bag: Path) -> None:
    solved = read_solved(bag)
    assert solved.equipment is not None
    axes = Figure().add_subplot()
    draw_equipment(axes, solved, solved.equipment)
    assert 0.5 < axes.get_ylim()[0] < 1.0, "the foot was never nearer than a millimetre"


def test_equipment_is_drawn_only_once_it_is_known_where_it_is(bag: Path) -> None:
    def lines_of_equipment(evaluation: Evaluation) -> int:
        axes = Figure().add_subplot()
        draw_figures(axes, evaluation)
        return sum(line.get_color() == EQUIPMENT_COLOUR for line in axes.get_lines())

    evaluation = evaluate(bag)
    record = evaluation.solved.equipment
    assert record is not None
    np.testing.assert_array_equal(np.flatnonzero(~evaluation.solved.placed), UNPLACED)
    drawn = lines_of_equipment(evaluation)
    late = replace(record, placed=np.arange(len(record.placed)) > len(record.placed) // 2)
    never = replace(record, placed=np.zeros_like(record.placed))
    drawn_late, drawn_never = (
        lines_of_equipment(replace(evaluation, solved=replace(evaluation.solved, equipment=changed)))
        for changed in (late, never)
    )
    assert drawn > drawn_late > drawn_never == 0


def test_without_equipment_nothing_is_said_of_it(walk: Walk, solved: Path, tmp_path: Path) -> None:
    assert read_solved(solved).equipment is None
    assert main(["evaluate", str(solved), "-o", str(tmp_path / "report")]) == 0
    assert "equipment" not in json.loads((tmp_path / "report/summary.json").read_text())


def test_a_message_that_contradicts_itself_is_named(bag: Path, tmp_path: Path) -> None:
    with BagFile(bag) as opened, write_recording(tmp_path / "odd") as writer:
        for topic, stamp_ns, message in opened.messages(opened.topics):
            if topic == EQUIPMENT:
                message.deviations = np.zeros(1)
            writer.write(topic, stamp_ns, message)
    with naming(RecordingError, tmp_path / "odd", "/equipment"):
        read_solved(tmp_path / "odd")
