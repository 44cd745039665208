"""What a replay is asked for: the files of one recording, and how it is solved."""

import json
from dataclasses import dataclass, replace
from pathlib import Path

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import SettingsError
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.recording.time_span import TimeSpan
from bodycam_ros.recording.topic_names import AS_RECORDED, TopicNames
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.replaying.first_pass import FirstPass
from bodycam_ros.replaying.recorded_part import WHOLE
from bodycam_ros.results.provenance import (
    BODY,
    EQUIPMENT,
    MAP,
    RECORDING,
    SETTINGS,
    body_record,
    map_record,
    settings_record,
)
from bodycam_ros.static_cameras.start_file import StaticCameraFiles


@dataclass(frozen=True)
class ReplayRequest:
    """Files and settings of one replay.

    Attributes:
        recording: ros2 bag folder or .mcap file.
        map: folder of the reference map; None with static cameras alone, in the frame of their file.
        body: YAML of the body.
        output: the ros2 bag folder to be; it appears whole or not at all.
        settings: of all stages.
        jobs: processes for the cameras.
        force: replace an output that is there already.
        equipment: name or file of the equipment that the body is coupled to.
        outside: static cameras, if there are any.
        slim: write no tracks, and of landmarks the poses by them alone.
        passes: over the recording: all but the last extend the map by the recording itself.
        imus: bags with the cameras' inertial sensors, beside those in the recording itself.
        names: of the recording's topics.
        span: the part of the recording that is solved.
        whole: solve all of it, also where few of the body's cameras run.
        first: clocks, read-out times and stretches by a first pass; None without one.
        stretch: the stretch of it that is solved, from 0 on; None for all of the recording.
        preview: solve parts of the recording alone, so many at most (``preview.py``); 0 for all of it.
    """

    recording: Path
    map: Path | None
    body: Path
    output: Path
    settings: PipelineSettings = PipelineSettings()
    jobs: int = 1
    force: bool = False
    equipment: str | Path | None = None
    outside: StaticCameraFiles | None = None
    slim: bool = False
    passes: int = 1
    imus: tuple[Path, ...] = ()
    names: TopicNames = AS_RECORDED
    span: TimeSpan = WHOLE
    whole: bool = False
    first: FirstPass | None = None
    stretch: int | None = None
    preview: int = 0

    def check_stretches(self) -> None:
        """Refuse what cannot be solved in stretches, as a stretch would need to know those before it.

        Raises:
            SettingsError: such a setting, or such inputs.
        """
        for is_asked, what, remedy in (
            *self._not_in_parts,
            (self.equipment is not None, "with equipment (--equipment)", ""),
            (self.settings.estimator.whole_recording, "with estimator.output_delay 'offline'", "; give frames"),
        ):
            if is_asked:
                raise SettingsError(
                    f"a recording is not solved in stretches {what}: each would need to know what came before it"
                    f"{remedy or '; replay it in one go'}"
                )

    def check_preview(self) -> None:
        """Refuse a preview of what depends on all of the recording.

        Raises:
            SettingsError: such inputs.
        """
        for is_asked, what, remedy in self._not_in_parts:
            if is_asked:
                raise SettingsError(
                    f"there is no preview {what}, which needs the whole recording{remedy or '; leave --preview out'}"
                )

    @property
    def _not_in_parts(self) -> tuple[tuple[bool, str, str], ...]:
        """What needs all of a recording: whether it is asked for, its name, and what to do in its place."""
        return (
            (self.outside is not None, "with static cameras (--stations)", ""),
            (self.passes > 1, "while the map is extended (--passes)", "; extend it first with 'bodycam map extend'"),
            (self.map is None, "without a map", ""),
            (bool(self.imus), "with inertial sensors (--imu)", ""),
        )

    @property
    def left_out_of_parts(self) -> tuple[str, ...]:
        """What a replay in one go does, and its stretches or a preview do not, a line each."""
        off = {
            "the map is not extended by what cameras see": self.settings.extension.enabled,
            "inertial sensors are not used": self.settings.inertial.enabled,
        }
        where = "a preview" if self.preview else "stretches"
        return tuple(f"in {where} {what}" for what, is_on in off.items() if is_on)

    def in_parts(self) -> "ReplayRequest":
        """Return the request without what depends on all that came before: a map that grows, inertial sensors."""
        settings = self.settings
        settings = replace(settings, extension=replace(settings.extension, enabled=False))
        return replace(self, settings=replace(settings, inertial=replace(settings.inertial, enabled=False)))

    def sources(
        self, body: BodyModel, reference_map: ReferenceMap | None, start_ns: int, first_stamp_ns: int
    ) -> dict[str, dict[str, str]]:
        """What the result says it was made from.

        Args:
            body: of the file, as it was read.
            reference_map: that the cameras are registered in, if any.
            start_ns: when the recording was begun [ns].
            first_stamp_ns: of its images [ns].
        """
        sources: dict[str, dict[str, str]] = {
            BODY: body_record(body),
            RECORDING: {
                "name": self.recording.resolve().name,
                "start_ns": str(start_ns),
                "first_stamp_ns": str(first_stamp_ns),
            },
            SETTINGS: settings_record(self.settings) | {"passes": str(self.passes), "slim": json.dumps(self.slim)},
        }
        if reference_map is not None and self.map is not None:
            sources[MAP] = map_record(reference_map, self.map)
        if self.equipment is not None:
            sources[EQUIPMENT] = {"name": Path(self.equipment).stem}
        return sources
