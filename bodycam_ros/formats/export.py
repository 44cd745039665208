"""``bodycam export``: the table of its formats, and files that are written whole or not at all."""

import logging
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from bodycam_ros.errors import BodyError, OutputError, RecordingError, SettingsError
from bodycam_ros.files.output_place import check_file, check_output
from bodycam_ros.files.whole_file import whole_files
from bodycam_ros.formats import bvh, c3d, csv, glb, mjcf, npz, opensim, ply, trc, tum, urdf, usd
from bodycam_ros.formats.sampled_motion import MotionOptions, sample_motion
from bodycam_ros.progress import Progress
from bodycam_ros.recording.time_span import TimeSpan
from bodycam_ros.results.solved_body import plain_name, read_solved_body
from bodycam_ros.results.solved_part import part_of

_WHOLE = TimeSpan()

logger = logging.getLogger(__name__)

Content = Mapping[str, str | bytes]
"""Content of a file, under "", and of files beside it, under the suffix that they have instead of the file's own."""


@dataclass(frozen=True)
class Format:
    """One format.

    Attributes:
        what: what it contains, and for which programs.
        mark: what every such file has near its beginning, by which ``--force`` recognises it.
        write: makes the content of the sampled motion and the options; or see below.
        options: fields of ``MotionOptions`` that it uses.
        beside: end of the names of files beside it -> the mark of such a file, and what it is.
        has_equipment: whether it contains the equipment beside the body.
        is_even: whether frames must be evenly spaced: the file has a rate and no times.
        of_body: it is written of the body of a bag or a body file: ``write`` takes it and the options.
    """

    what: str
    mark: str | bytes
    write: Callable[..., str | bytes | Content]
    options: frozenset[str] = frozenset()
    beside: Mapping[str, tuple[bytes, str]] = field(default_factory=dict)
    has_equipment: bool = False
    is_even: bool = False
    of_body: bool = False

    def content(self, source: Path, options: MotionOptions, progress: Progress, span: TimeSpan) -> Content:
        """The content made of a source.

        Raises:
            BodycamError: the source cannot be read, or lacks what the format needs.
        """
        if self.of_body:
            body = urdf.read_source(source)
            try:
                written = self.write(body, options)
            except BodyError as error:
                raise BodyError(f"{source}: {error}") from error
        elif source.is_file() and urdf.is_body_file(source):
            raise RecordingError(f"{source}: has no motion; give a bag that 'bodycam replay' wrote")
        else:
            motion = sample_motion(part_of(read_solved_body(source, progress), span), options.rate, self.is_even)
            has_equipment = self.has_equipment and options.character is None
            if not has_equipment and motion.body.equipment_segments:
                logger.warning(
                    "%s: %s, which are no part of the body, are left out; %s have them",
                    source,
                    ", ".join(sorted(motion.body.equipment_segments)),
                    ", ".join(name for name, form in FORMATS.items() if form.has_equipment),
                )
            written = self.write(motion, options)
        return {"": written} if isinstance(written, str | bytes) else written


_RATE = frozenset({"rate"})
_FIGURE = frozenset({"rate", "pose", "names"})
_STAGE = frozenset({"surface", "environment", "travel"})
_MODEL = {opensim.MODEL_SUFFIX: (opensim.MODEL_MARK.encode(), "OpenSim model")}

FORMATS: Mapping[str, Format] = {
    "urdf": Format(
        "the body, for RViz and every tool that reads robots", "<robot",
        urdf.write_urdf, frozenset({"mass"}), of_body=True,
    ),
    "mjcf": Format(
        "the body with its loops closed, for MuJoCo", "<mujoco",
        lambda body, options: mjcf.mjcf_text(body), of_body=True,
    ),
    "bvh": Format(
        "the motion as bones, for Blender, MotionBuilder, Maya", bvh.MARK, bvh.write_bvh, _FIGURE | {"up", "scale"},
        is_even=True,
    ),
    "trc": Format(
        "virtual markers, with a model (.osim) beside them, for OpenSim", trc.MARK, trc.write_trc, _RATE, _MODEL,
        is_even=True,
    ),
    "mot": Format(
        "joint angles, with the model (.osim) that they move beside them, for OpenSim", opensim.MOTION_MARK,
        opensim.write_mot, _RATE, _MODEL, is_even=True,
    ),
    "c3d": Format(
        "virtual markers, for the programs of motion laboratories", c3d.SOFTWARE, c3d.write_c3d, _RATE | {"up"},
        is_even=True,
    ),
    "glb": Format(
        "a skin on moving bones (glTF), for every viewer, Blender, Unity, Unreal, the web", glb.MARK, glb.write_glb,
        _FIGURE | _STAGE | {"character", "bones"}, has_equipment=True,
    ),
    "csv": Format(
        "positions, quaternions and joint angles, a row per frame, for spreadsheets", csv.MARK, csv.write_csv, _RATE,
        has_equipment=True,
    ),
    "tum": Format(
        "the trajectory of the root, a segment or a camera, for evo", tum.MARK, tum.write_tum, _RATE | {"segment"},
        {".tum": (tum.MARK.encode(), "trajectory")}, has_equipment=True,
    ),
    "npz": Format("everything as NumPy arrays", npz.MARK, npz.write_npz, _RATE, has_equipment=True),
    "ply": Format(
        "landmarks and trajectories of segments as a point cloud, for MeshLab, CloudCompare", ply.MARK, ply.write_ply,
        _RATE, has_equipment=True,
    ),
    "usd": Format(
        "a skin on moving bones (UsdSkel), for Omniverse, Houdini, Maya", usd.MARK, usd.write_usd,
        _FIGURE | _STAGE | {"up", "scale"},
        has_equipment=True, is_even=True,
    ),
}  # fmt: skip


def export(
    sources: Sequence[Path],
    format_name: str,
    output: Path,
    force: bool,
    options: MotionOptions,
    progress: Progress,
    span: TimeSpan = _WHOLE,
) -> list[Path]:
    """Write solved bags or body files in a format, all files or none.

    Args:
        sources: what to export.
        format_name: key of ``FORMATS``.
        output: file to write; of several sources the folder, which is made, for a file each that is named after it.
        force: replace earlier files of the same kind.
        options: how motion is written.
        progress: of reading.
        span: the part of the recordings that is written.

    Returns:
        The files that were written.

    Raises:
        BodycamError: a source cannot be read or lacks what the format needs, the format does not use an option, two
            sources have the same name, or the output cannot be written.
    """
    chosen = FORMATS[format_name]
    _check_options(format_name, options)
    outputs, folder = {output: sources[0]}, output.parent
    if len(sources) == 1 and (named := output.suffix.lower().removeprefix(".")) in FORMATS and named != format_name:
        raise OutputError(
            f"{output}: is named as {named}, but would be {format_name}; give another name, or --to {named}"
        )
    if len(sources) > 1:
        if output.exists() and not output.is_dir():
            raise OutputError(f"{output}: is a file; several recordings are written into a folder")
        outputs = {output / f"{name}.{format_name}": source for name, source in _unique_names(sources).items()}
        folder = output
    mark = chosen.mark if isinstance(chosen.mark, bytes) else chosen.mark.encode()
    for path in outputs:
        check_file(path, force, mark, format_name)
    contents: dict[Path, bytes] = {}
    for path, source in outputs.items():
        contents |= _contents(chosen.content(source, options, progress, span), path)
    beside = {path: content for path, content in contents.items() if path not in outputs}
    unchanged = {path for path, content in beside.items() if path.is_file() and path.read_bytes() == content}
    for path in beside.keys() - unchanged:
        check_output(path, sources)
        check_file(path, force, *next(mark for end, mark in chosen.beside.items() if path.name.endswith(end)))
    with whole_files(folder, inside=len(sources) == 1) as scratch:
        for path in contents.keys() - unchanged:
            (scratch / path.name).write_bytes(contents[path])
    return list(contents)


def _check_options(format_name: str, options: MotionOptions) -> None:
    if unused := [option for option in options.given if option not in FORMATS[format_name].options]:
        able = [name for name, form in FORMATS.items() if set(unused) <= form.options]
        flags = ", ".join(f"--{option}" for option in unused)
        hint = f"; {', '.join(able)} {'uses' if len(able) == 1 else 'use'} it" if able else ""
        raise SettingsError(f"{flags} has no effect on {format_name}{hint}")


def _contents(made: Content, output: Path) -> dict[Path, bytes]:
    """Path of a file -> what is to be in it.

    Raises:
        OutputError: two of the files would have one path.
    """
    paths = {suffix: output.with_suffix(suffix) if suffix else output for suffix in made}
    if twice := [path for path, count in Counter(paths.values()).items() if count > 1]:
        raise OutputError(
            f"{twice[0]}: would be two of the files to write; choose another name, or rename the segments"
        )
    return {paths[suffix]: text.encode() if isinstance(text, str) else text for suffix, text in made.items()}


def _unique_names(sources: Sequence[Path]) -> Mapping[str, Path]:
    """Name -> source; with as many of its folders as make all names differ."""
    places = [source.resolve().with_name(plain_name(source)) for source in sources]
    for length in range(1, 1 + max(len(place.parts) for place in places)):
        names = ["_".join(place.parts[1:][-length:]) for place in places]
        if len(set(names)) == len(names):
            return dict(zip(names, sources, strict=True))
    raise OutputError(f"{', '.join(map(str, sources))}: the same recording is given twice; give each once")
