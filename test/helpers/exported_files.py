"""Exports of a solved recording, and where OUT has the joints."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.coupled_body import coupled_body
from bodycam_ros.cli.main import main
from bodycam_ros.results.solved_recording import SolvedRecording, read_solved
from helpers.athletes import Athlete
from helpers.known_walk import START_NS, Walk, write_solved

JOINT_M = 1e-3
"""What issue and users ask for."""

Poses = NDArray[np.float64]


@dataclass(frozen=True)
class Exported:
    """A solved bag, and a folder for files of it."""

    out: Path
    folder: Path
    solved: SolvedRecording

    @classmethod
    def of(cls, out: Path, folder: Path) -> "Exported":
        return cls(out, folder, read_solved(out))

    def file(self, to: str, *flags: str, name: str = "motion") -> Path:
        output = self.folder / f"{name}.{to}"
        assert main(["export", str(self.out), "--to", to, "-o", str(output), *flags]) == 0
        return output

    def places(self, segment: str) -> Poses:
        """(T, 3) where the URDF's forward kinematics has a segment's joint [m]."""
        return self.solved.world_T_link[segment][:, :3, 3]

    @property
    def seconds(self) -> Poses:
        stamps = self.solved.stamps_ns
        return (stamps - stamps[0]) * 1e-9


def solved_ride(athlete: Athlete, folder: Path) -> Exported:
    """An athlete with equipment as a bag of a replay without error, and a folder for files of it."""
    stamps_ns = START_NS + np.round(athlete.times * 1e9).astype(np.int64)
    poses = np.concatenate([athlete.poses, athlete.equipment_poses], axis=1)
    walk = Walk(coupled_body(athlete.body, athlete.equipment), stamps_ns, poses)
    return Exported.of(write_solved(walk, folder / "ride"), folder)
