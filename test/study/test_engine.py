"""Which steps the engine runs: Snakemake itself, with exports of a body as steps, of 0.4 s each."""

import json
import os
import shutil
from pathlib import Path

import pytest
from helpers.naming import naming
from psutil import Process

import bodycam_ros
from bodycam_ros.errors import StudyError
from bodycam_ros.study import engine as engine_module
from bodycam_ros.study.engine import Engine, StepEnd, find_profile
from bodycam_ros.study.input_files import files_in
from bodycam_ros.study.step_graph import StepGraph
from bodycam_ros.study.step_needs import StepNeeds, count_images, count_photographs
from bodycam_ros.study.study import Step
from bodycam_ros.study.study_lock import study_lock

ROOT = Path(bodycam_ros.__file__).parent.parent


@pytest.fixture
def folder(sample: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of results, whose name a shell or Snakemake might take for more, beside a body."""
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    folder = tmp_path / "it's {all}"
    folder.mkdir()
    shutil.copy(sample / "body.yaml", tmp_path / "body.yaml")
    return folder


def steps_of(folder: Path, *flags: str) -> list[Step]:
    """A robot of the body, and a model made of that."""
    robot, model = folder / "robot 1.urdf", folder / "model" / "model.xml"
    first = ("export", folder.parent / "body.yaml", "--to", "urdf", "-o", robot, "--force", *flags)
    second = ("export", robot, "--to", "mjcf", "-o", model, "--force")
    return [Step("walk 1: export urdf", first, robot), Step("walk 1: export mjcf", second, model)]


def engine_of(steps: list[Step], folder: Path) -> Engine:
    return Engine(StepGraph(steps, folder, is_logged=True), StepNeeds(steps, 1), 1, None)


def run(steps: list[Step], folder: Path) -> tuple[list[Step], list[StepEnd]]:
    """What was planned, and how it ended."""
    engine = engine_of(steps, folder)
    planned = engine.steps_to_run()
    if not planned:
        return [], []
    with study_lock(folder) as lock:
        events = list(engine.run(planned, lock))
    return planned, [event for event in events if isinstance(event, StepEnd)]


def test_a_step_is_done_until_something_changes(folder: Path) -> None:
    steps = steps_of(folder)
    planned, ends = run(steps, folder)
    assert planned == steps and [(end.step, end.failure) for end in ends] == [(step, None) for step in steps]
    graph = StepGraph(steps, folder, is_logged=True)
    assert [graph.exit_code(step) for step in steps] == [0, 0] and 0.1 < (graph.seconds(steps[0]) or 0.0) < 60.0
    assert engine_of(steps, folder).steps_to_run() == []
    body = folder.parent / "body.yaml"
    os.utime(body)  # newer, but the same
    assert engine_of(steps, folder).steps_to_run() == []
    body.write_text(body.read_text() + "# another\n")
    assert engine_of(steps, folder).steps_to_run() == steps


@pytest.mark.long
def test_another_flag_or_a_missing_output_are_reasons_to_run(folder: Path) -> None:
    steps = steps_of(folder)
    run(steps, folder)
    assert engine_of(steps_of(folder, "--mass", "70"), folder).steps_to_run() == steps_of(folder, "--mass", "70")
    shutil.rmtree(steps[1].output.parent)
    assert engine_of(steps, folder).steps_to_run() == [steps[1]]
    moved = folder.rename(folder.parent / "moved")
    assert [step.name for step in engine_of(steps_of(moved), moved).steps_to_run()] == [steps[1].name]


@pytest.mark.long
@pytest.mark.parametrize("name", [b"{in}.yaml", b"in\xff.yaml"])
def test_an_input_whose_path_the_engine_cannot_take_counts_as_any(folder: Path, name: bytes) -> None:
    body = folder.parent / os.fsdecode(name)
    shutil.copy(folder.parent / "body.yaml", body)
    step = Step("walk: export urdf", ("export", body, "--to", "urdf", "-o", folder / "a.urdf"), folder / "a.urdf")
    assert [end.failure for end in run([step], folder)[1]] == [None]
    assert engine_of([step], folder).steps_to_run() == []
    body.write_text(body.read_text() + "# another\n")
    assert engine_of([step], folder).steps_to_run() == [step]


@pytest.mark.long
def test_names_as_long_as_a_file_may_have_and_a_readers_own_files_change_nothing(
    folder: Path, monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory
) -> None:
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    (elsewhere / "random.py").write_text("raise SystemExit('a file of the user')\n")
    monkeypatch.chdir(elsewhere)
    monkeypatch.setenv("SNAKEMAKE_PROFILE", "not_there")
    name = "\u65e5" * 80  # 240 bytes
    made = folder / f"{name}.urdf"
    step = Step(f"{name}: export urdf", ("export", folder.parent / "body.yaml", "--to", "urdf", "-o", made), made)
    assert [end.failure for end in run([step], folder)[1]] == [None]
    assert engine_of([step], folder).steps_to_run() == []


@pytest.mark.long
def test_an_engine_that_is_killed_after_a_step_failed_is_named(folder: Path) -> None:
    broken, made = folder.parent / "broken.yaml", folder / "broken.urdf"
    broken.write_text("nonsense: true\n")
    steps = [Step("a: export urdf", ("export", broken, "--to", "urdf", "-o", made), made), *steps_of(folder)]
    engine = engine_of(steps, folder)
    with study_lock(folder) as lock, naming(StudyError, folder):
        for event in engine.run(engine.steps_to_run(), lock):
            if isinstance(event, StepEnd) and event.failure:
                (own,) = Process().children()
                own.kill()


def test_files_of_a_step_are_all_that_can_be_read_each_once(tmp_path: Path) -> None:
    take, other = tmp_path / "take", tmp_path / "other"
    for path in (take / "b" / "c.mp4", take / "a.mp4", other / "d.mp4"):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    (take / "again").symlink_to(take)
    (take / "b" / "again").symlink_to(take)
    (take / "lens").symlink_to(other)
    (take / "notes.txt").symlink_to(tmp_path / "nowhere")
    os.mkfifo(take / "pipe")
    assert files_in(take) == [take / "a.mp4", take / "b" / "c.mp4", take / "lens" / "d.mp4"]
    assert files_in(take / "a.mp4") == [take / "a.mp4"] and files_in(tmp_path / "nowhere") == [tmp_path / "nowhere"]


def test_what_was_changed_by_hand_is_never_replaced(folder: Path) -> None:
    steps = steps_of(folder)
    run(steps, folder)
    robot, body = steps[0].output, folder.parent / "body.yaml"
    robot.write_text(robot.read_text() + "<!-- corrected -->\n")
    assert engine_of(steps, folder).steps_to_run() == [steps[1]]  # only what reads it must run again
    assert [end.failure for end in run(steps, folder)[1]] == [None]
    assert engine_of(steps, folder).steps_to_run() == []
    body.write_text(body.read_text() + "# another\n")
    with naming(StudyError, robot):
        engine_of(steps, folder).steps_to_run()


@pytest.mark.long
def test_what_fails_leaves_the_earlier_result_and_is_tried_again(folder: Path) -> None:
    steps = steps_of(folder)
    run(steps, folder)
    body, text = folder.parent / "body.yaml", steps[0].output.read_text()
    good = body.read_text()
    body.write_text("nonsense: true\n")
    _, ends = run(steps, folder)
    assert [end.step for end in ends] == steps
    assert (
        "body.yaml" in str(ends[0].failure)
        and str(ends[1].failure) == f"not run, because step '{steps[0].name}' failed"
    )
    assert steps[0].output.read_text() == text and steps[1].output.exists()
    assert engine_of(steps, folder).steps_to_run() == steps
    body.write_text(good)
    assert [end.failure for end in run(steps, folder)[1]] == [None, None]


def test_a_body_of_which_nothing_is_known_is_taken_for_corrected(folder: Path) -> None:
    body = folder / "body.yaml"
    shutil.copy(folder.parent / "body.yaml", body)
    step = Step("body", ("body", folder.parent, "-o", body), body)
    with naming(StudyError, body):
        engine_of([step], folder).steps_to_run()


def test_a_profile_is_a_folder_the_users_own_or_ours(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    ours = Path(find_profile("slurm"))
    assert "executor: slurm" in (ours / "config.yaml").read_text()
    own = tmp_path / "snakemake" / "slurm"
    own.mkdir(parents=True)
    (own / "config.yaml").touch()
    assert find_profile("slurm") == str(own) and find_profile(str(ours)) == str(ours)
    with naming(StudyError, "nowhere", own.parent):
        find_profile("nowhere")
    monkeypatch.chdir(tmp_path)
    shutil.rmtree(own.parent)
    (tmp_path / "slurm").mkdir()  # no profile
    assert find_profile("slurm") == str(ours)


def test_without_snakemake_it_is_named(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine_module, "find_spec", lambda name: None)
    with naming(StudyError, "bodycam_ros[study]"):
        run(steps_of(folder), folder)


def test_needs_follow_from_the_images_of_what_a_step_was_made_of(sample: Path, tmp_path: Path) -> None:
    bag = sample / "sample" / "bag"
    assert count_images(bag) == 16 * 60 and count_photographs(sample / "reference") == 14
    broken = tmp_path / "broken"
    broken.mkdir()
    information = "{topics_with_message_count: [{message_count: x, topic_metadata: {type: 3}}]}"
    (broken / "metadata.yaml").write_text(f"rosbag2_bagfile_information: {information}")
    assert count_images(broken) == 0
    videos, made = tmp_path / "videos", tmp_path / "bag"
    videos.mkdir()
    (videos / "head.mp4").touch()
    os.truncate(videos / "head.mp4", 2_000_000_000)
    steps = [
        Step("a: ingest", ("ingest", videos, "-o", made), made),
        Step("a: replay", ("replay", made, "-o", tmp_path / "out"), tmp_path / "out"),
        Step("b: replay", ("replay", bag, "-o", tmp_path / "other"), tmp_path / "other"),
    ]
    StepGraph(steps, tmp_path, is_logged=True).write(tmp_path / "graph.json", StepNeeds(steps, 4))
    ingest, long, short = json.loads((tmp_path / "graph.json").read_text())
    assert ingest["threads"] == long["threads"] == 4
    assert long["minutes"] > short["minutes"] and long["memory_mb"] > short["memory_mb"] > 900
