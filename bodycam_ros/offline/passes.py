"""Several passes over a recording: the map grows in all but the last, which solves."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import gettempdir

from bodycam_ros.body.body_file import read_body
from bodycam_ros.equipment.coupled_body import coupled_body, held_equipment
from bodycam_ros.growth.extension_round import ExtensionRound
from bodycam_ros.offline.extend import MapExtension, OnProgress
from bodycam_ros.offline.known_readouts import known_readouts
from bodycam_ros.offline.replay import replay
from bodycam_ros.offline.replay_summary import ReplaySummary
from bodycam_ros.outside.hands import with_hands
from bodycam_ros.outside.outside_files import OutsideInput
from bodycam_ros.pipeline_settings import PipelineSettings
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.whole_file import scratch_folder


def replay_in_passes(
    recording_path: Path,
    map_path: Path | None,
    body_path: Path,
    output_path: Path,
    settings: PipelineSettings,
    jobs: int,
    passes: int = 1,
    force: bool = False,
    on_step: OnProgress = lambda step, share: None,
    on_progress: Callable[[float], None] = lambda seconds: None,
    equipment: str | Path | None = None,
    outside: OutsideInput | None = None,
    slim: bool = False,
) -> tuple[ReplaySummary, Sequence[ExtensionRound]]:
    """As ``replay``, with the map extended by the recording itself before; and what each round of that brought.

    Args:
        recording_path, map_path, body_path, output_path, settings, jobs, force, on_progress, equipment, outside: as of
            ``replay``, and so is slim.
        passes: over the recording, the last one included.
        on_step: called with each step before the last pass or beside it, and the share of it that is done.

    Raises:
        BodycamError: as ``replay``.
    """
    if passes == 1 or map_path is None:
        summary = replay(
            recording_path,
            map_path,
            body_path,
            output_path,
            settings,
            jobs,
            force,
            on_progress,
            equipment,
            on_step,
            outside,
            slim,
        )
        return summary, ()
    person = read_body(body_path)
    held = None if equipment is None else held_equipment(equipment, with_hands(person) if outside else person)
    body = coupled_body(person, held)
    with open_recording(recording_path) as recording:
        cameras = [camera for camera in recording.cameras if camera in body.mounts]
        readouts = known_readouts(recording, body, cameras)
    rounds = replace(settings, extend=replace(settings.extend, rounds=passes - 1))
    extension = MapExtension(recording_path, map_path, rounds, jobs, cameras, readouts, on_step)
    with scratch_folder(Path(gettempdir())) as scratch:
        extension.run().save(scratch / "map")
        summary = replay(
            recording_path,
            scratch / "map",
            body_path,
            output_path,
            settings,
            jobs,
            force,
            on_progress,
            held,
            on_step,
            outside,
            slim,
        )
    summary.elapsed_s += extension.elapsed_s
    return summary, extension.rounds
