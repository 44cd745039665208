"""What ``bodycam export`` writes: a new format is a new line of the table."""

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from bodycam_ros.errors import RecordingError
from bodycam_ros.formats import bvh, c3d, csv, glb, mot, npz, osim, ply, robot_files, trc, tum, usd
from bodycam_ros.formats.options import MotionOptions
from bodycam_ros.formats.sampled_motion import SampledMotion, sampled
from bodycam_ros.mapping.progress import Progress
from bodycam_ros.results.solved_body import read_solved_body

logger = logging.getLogger(__name__)

Content = Mapping[str, str | bytes]
"""What is in a file, under "", and in files beside it, under the suffix that they have instead of the file's own."""

Make = Callable[[Path, MotionOptions, Progress], Content]
"""Makes the content of a solved bag or, of formats that hold no motion, of a body file."""


@dataclass(frozen=True)
class Format:
    """One format.

    Attributes:
        what: for whom it is, and what it holds.
        mark: what every such file has near its beginning.
        content: what makes it.
        options: fields of ``MotionOptions`` that it heeds.
        beside: end of the names of files beside it -> the mark of such a file, and what it is.
    """

    what: str
    mark: bytes
    content: Make
    options: frozenset[str] = frozenset()
    beside: Mapping[str, tuple[bytes, str]] = field(default_factory=dict)


def _of_motion(
    write: Callable[[SampledMotion, MotionOptions], str | bytes | Content], even: bool, alone: bool = True
) -> Make:
    """What makes the content of the motion in a solved bag.

    Args:
        write: makes it.
        even: the file says a rate and no times.
        alone: it has the body without the equipment beside it.
    """

    def content(source: Path, options: MotionOptions, progress: Progress) -> Content:
        motion = sampled(read_solved_body(source, progress), options.rate, even)
        if alone and motion.body.equipment_segments:
            logger.warning(
                "%s: %s, which are no part of the body, are left out; csv, npz, tum and ply have them",
                source,
                ", ".join(sorted(motion.body.equipment_segments)),
            )
        written = write(motion, options)
        return {"": written} if isinstance(written, str | bytes) else written

    return _of_bag(content)


def _of_bag(make: Make) -> Make:
    """The same, of bags alone."""

    def content(source: Path, options: MotionOptions, progress: Progress) -> Content:
        if source.is_file() and not robot_files.is_bag(source):
            raise RecordingError(f"{source}: holds no motion; give a bag that 'bodycam replay' wrote")
        return make(source, options, progress)

    return content


_RATE = frozenset({"rate"})
_FIGURE = frozenset({"rate", "pose", "names"})
_MODEL = {mot.OSIM_SUFFIX: (osim.MARK.encode(), "OpenSim model")}

FORMATS: Mapping[str, Format] = {
    "urdf": Format(
        "the body, for RViz and every tool that reads robots",
        b"<robot",
        lambda source, options, progress: robot_files.robot_description(source, options.mass),
        options=frozenset({"mass"}),
        beside={robot_files.LOOPS_SUFFIX: (robot_files.LOOPS_HEADER.encode(), "loops of a URDF")},
    ),
    "mjcf": Format(
        "the body with its loops closed, for MuJoCo",
        b"<mujoco",
        lambda source, options, progress: robot_files.mjcf(source),
    ),
    "bvh": Format(
        "the motion as bones, for Blender, MotionBuilder, Maya",
        bvh.MARK.encode(),
        _of_motion(bvh.bvh, even=True),
        options=_FIGURE | {"up", "scale"},
    ),
    "trc": Format(
        "virtual markers, with a model (.osim) beside them, for OpenSim",
        trc.MARK.encode(),
        _of_motion(trc.trc, even=True),
        options=_RATE,
        beside=_MODEL,
    ),
    "mot": Format(
        "joint angles, with the model (.osim) that they move beside them, for OpenSim",
        mot.MARK.encode(),
        _of_motion(mot.mot, even=True),
        options=_RATE,
        beside=_MODEL,
    ),
    "c3d": Format(
        "virtual markers, for the programs of motion laboratories",
        c3d.SOFTWARE.encode(),
        _of_motion(c3d.c3d, even=True),
        options=_RATE | {"up"},
    ),
    "glb": Format(
        "a skin on moving bones (glTF), for every viewer, Blender, Unity, Unreal, the web",
        glb.MARK.encode(),
        _of_motion(glb.glb, even=False),
        options=_FIGURE,
    ),
    "csv": Format(
        "places, quaternions and joint angles, a row an instant, for spreadsheets",
        csv.MARK.encode(),
        _of_motion(csv.csv, even=False, alone=False),
        options=_RATE,
    ),
    "tum": Format(
        "the trajectory of the root, a segment or a camera, for evo",
        tum.MARK.encode(),
        _of_motion(tum.tum, even=False, alone=False),
        options=_RATE | {"segment"},
        beside={".tum": (tum.MARK.encode(), "trajectory")},
    ),
    "npz": Format("everything as NumPy arrays", npz.MARK, _of_motion(npz.npz, even=False, alone=False), options=_RATE),
    "ply": Format(
        "landmarks and the ways of segments as a cloud of points, for MeshLab, CloudCompare",
        ply.MARK.encode(),
        _of_bag(ply.ply),
        options=_RATE,
    ),
    "usd": Format(
        "a skin on moving bones (UsdSkel), for Omniverse, Houdini, Maya",
        usd.MARK.encode(),
        _of_motion(usd.usd, even=True),
        options=_FIGURE,
    ),
}
