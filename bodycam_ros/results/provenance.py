"""What a result was made from: map, body, recording and settings, as records in its bag; whether others fit it."""

import json
import logging
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from bodycam_ros.body.body_identity import body_identity
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.body_yaml import yaml_text
from bodycam_ros.errors import RecordingError
from bodycam_ros.recording.bag_records import PROGRAM, BagRecords, read_bag_records
from bodycam_ros.recording.bag_writer import RecordingWriter
from bodycam_ros.registration.map_identity import MapIdentity, map_identity
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.settings import SettingsGroups

logger = logging.getLogger(__name__)

MAP, BODY, RECORDING, SETTINGS, EQUIPMENT = "map", "body", "recording", "settings", "equipment"
"""Names of records; map and body have "name" and "identity"."""

PREVIEW = "preview"
"""In the record of the recording: how much of it is solved, where that is a preview."""

BODY_FILE, VERDICT_FILE = "body.yaml", "verdict.json"
"""Attachments: the body as its file describes it, and the quality findings as on ``/verdict``."""

_MEASURED_IN = "measured_in_"


def map_record(reference_map: ReferenceMap, path: Path) -> dict[str, str]:
    """The record of a map: name of its folder, identity, and how many landmarks it has."""
    return {
        "name": path.resolve().name,
        "identity": str(map_identity(reference_map)),
        "landmarks": str(len(reference_map.landmark_ids)),
        "added_landmarks": str(reference_map.grown),
    }


def body_record(body: BodyModel) -> dict[str, str]:
    """The record of a body: name, identity, and the map that it was measured in where its report has it."""
    record, measured_in = {"name": body.name, "identity": body_identity(body)}, body.report.get(MAP)
    if isinstance(measured_in, Mapping):
        record |= {f"{_MEASURED_IN}{key}": str(measured_in.get(key, "unknown")) for key in ("name", "identity")}
    return record


def write_sources(
    writer: RecordingWriter, records: Mapping[str, Mapping[str, str]], body: BodyModel, stamp_ns: int
) -> None:
    """Append the records of what a result is made from, and the file of its body, logged at a time [ns]."""
    for name, record in records.items():
        writer.add_metadata(name, record)
    writer.attach(BODY_FILE, "application/yaml", yaml_text(body), stamp_ns)


def settings_record(settings: SettingsGroups) -> dict[str, str]:
    """The record of settings: group.setting -> value as in YAML and JSON."""
    groups = settings.as_mapping().items()
    return {f"{group}.{name}": json.dumps(value) for group, values in groups for name, value in values.items()}


@dataclass(frozen=True)
class Provenance:
    """What a bag was made from.

    Attributes:
        path: of the bag.
        records: of it, and files attached to it; of another program's bag neither.
    """

    path: Path
    records: BagRecords

    @classmethod
    def read(cls, path: Path) -> "Provenance":
        """Provenance of a bag folder or file."""
        return cls(path, read_bag_records(path))

    def copy_to(self, writer: RecordingWriter, stamp_ns: int) -> None:
        """Append the records of map, body, recording and equipment, and the body's file, to a bag made from this."""
        for name in (MAP, BODY, RECORDING, EQUIPMENT):
            if (record := self.records.metadata.get(name)) is not None:
                writer.add_metadata(name, record)
        if (body := self.records.attachments.get(BODY_FILE)) is not None:
            writer.attach(BODY_FILE, "application/yaml", body.decode(errors="replace"), stamp_ns)

    @property
    def sources(self) -> dict[str, dict[str, str]]:
        """Records of program, map, body, recording and equipment, those that are there."""
        names = (PROGRAM, MAP, BODY, RECORDING, EQUIPMENT)
        return {name: dict(self.records.metadata[name]) for name in names if name in self.records.metadata}

    @property
    def lines(self) -> list[str]:
        """What the bag was made from in sentences; none of bags of older versions and other programs."""
        made = self.sources
        if BODY not in made or PROGRAM not in made:
            return []
        where = f" in map {_named(made[MAP])}" if MAP in made else ""
        by = f"{made[PROGRAM].get('command', 'unknown')} {made[PROGRAM].get('version', '')}".strip()
        preview = made.get(RECORDING, {}).get(PREVIEW)
        return [
            f"solved by {by} with body {_named(made[BODY])}{where}",
            *([f"a preview: {preview}"] if preview else ()),
            *source_remarks(made),
        ]

    def map_difference(self, reference_map: ReferenceMap, path: Path) -> str | None:
        """Why a map is not that of the bag, with both names; None where it is, or extends it, or nothing is known."""
        made_in, given = self.records.metadata.get(MAP), map_identity(reference_map)
        if made_in is None or MapIdentity.parse(made_in.get("identity", "")).shares_world(given):
            return None
        return (
            f"{self.path} was solved in map {_named(made_in)}, but {path} is another map ({given}), so the body and "
            "its landmarks do not fit together; give the map that was used, or replay the recording in this one"
        )

    def body_difference(self, body: BodyModel, path: Path) -> str | None:
        """Why a body is not that of the bag, with both names; None where it is, or nothing is known."""
        solved_with, given = self.records.metadata.get(BODY), body_identity(body)
        if solved_with is None or solved_with.get("identity") == given:
            return None
        return (
            f"{self.path} was solved with body {_named(solved_with)}, but {path} is another body, {body.name} "
            f"({given}); the motion shown is that of the first. Replay the recording with the second to see its motion"
        )


def check_same_inputs(one: Provenance, other: Provenance) -> None:
    """Refuse two results whose motions cannot be compared; nothing is known of bags of other programs.

    Raises:
        RecordingError: they were solved in another map, or with another body.
    """
    for name in (MAP, BODY):
        ours, theirs = (each.records.metadata.get(name) for each in (one, other))
        if ours is None or theirs is None:
            continue
        identities = [record.get("identity", "") for record in (ours, theirs)]
        if name == MAP:
            first, second = map(MapIdentity.parse, identities)
            is_same = first.shares_world(second)
        else:
            is_same = identities[0] == identities[1]
        if not is_same:
            raise RecordingError(
                f"{other.path}: was solved with {name} {_named(theirs)}, {one.path} with {name} {_named(ours)}; replay "
                "the recording twice with the same"
            )


def warn_of_differences(
    solved: Path, a_map: tuple[ReferenceMap, Path] | None = None, body: tuple[BodyModel, Path] | None = None
) -> None:
    """Warn where a map or a body, each with its path, is not what a bag was made from."""
    provenance = Provenance.read(solved)
    differences = (
        None if a_map is None else provenance.map_difference(*a_map),
        None if body is None else provenance.body_difference(*body),
    )
    for difference in filter(None, differences):
        logger.warning("%s", difference)


def source_remarks(records: Mapping[str, Mapping[str, str]]) -> tuple[str, ...]:
    """A remark where the records of a result have a body that was measured in another map; else none."""
    body, solved_in = records.get(BODY, {}), records.get(MAP, {})
    measured_in = {key.removeprefix(_MEASURED_IN): body[key] for key in body if key.startswith(_MEASURED_IN)}
    identities = [MapIdentity.parse(each["identity"]) for each in (measured_in, solved_in) if "identity" in each]
    if len(identities) < 2 or identities[0].shares_world(identities[1]):
        return ()
    return (
        f"body {body['name']} was measured in map {_named(measured_in)} and solved in map {_named(solved_in)}: its "
        "lengths are right here only if the boards of both maps have the same scale",
    )


def _named(record: Mapping[str, str]) -> str:
    return f"{record.get('name', 'unknown')} ({record.get('identity', 'unknown')})"
