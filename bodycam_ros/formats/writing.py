"""Writes what is exported: every file whole or none, and never over what no such command wrote."""

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

from bodycam_ros.errors import OutputError, SettingsError
from bodycam_ros.formats.formats import FORMATS, Format
from bodycam_ros.formats.options import MotionOptions
from bodycam_ros.formats.robot_files import remove_stale, stale_loops
from bodycam_ros.mapping.progress import Progress
from bodycam_ros.output_place import check_file, check_output
from bodycam_ros.results.solved_body import plain_name
from bodycam_ros.whole_file import whole_file, whole_files


def export(
    source: Path, format_name: str, output: Path, force: bool, options: MotionOptions, progress: Progress
) -> list[Path]:
    """Write a solved bag or a body file in a format, whole or not at all.

    Args:
        source: what to export.
        format_name: key of ``FORMATS``.
        output: file to write.
        force: replace earlier files of the same kind.
        options: how motion is written.
        progress: is told what is read.

    Returns:
        The files that were written.

    Raises:
        BodycamError: the source cannot be read or lacks what the format needs, the format does not heed an option, or
            the output cannot be written.
    """
    chosen = FORMATS[format_name]
    _check_options(format_name, options)
    check_file(output, force, chosen.mark, format_name)
    contents = _contents(source, output, chosen, options, progress)
    stale = _stale([output], contents, format_name, force)
    with ExitStack() as stack:
        for path, content in contents.items():
            if path != output:
                check_output(path, (source,), makes_folders=False)
                if not _check_beside(path, content, force, chosen):
                    continue
            stack.enter_context(whole_file(path)).write_bytes(content)
    for path in stale:
        remove_stale(path)
    return list(contents)


def export_all(
    sources: Sequence[Path],
    format_name: str,
    folder: Path,
    force: bool,
    options: MotionOptions,
    progress: Progress,
) -> list[Path]:
    """Write several solved bags or body files into a folder, a file each that is named after its source; all or none.

    Args:
        sources: what to export.
        format_name: key of ``FORMATS``.
        folder: is made if it is not there; other files in it stay.
        force: replace earlier files of the same kind.
        options: how motion is written.
        progress: is told what is read.

    Returns:
        The files that were written.

    Raises:
        BodycamError: as of ``export``; or two sources cannot be told apart.
    """
    chosen = FORMATS[format_name]
    _check_options(format_name, options)
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"{folder}: is a file; several recordings are written into a folder")
    outputs = {folder / f"{name}.{format_name}": source for name, source in _named_apart(sources).items()}
    for output in outputs:
        check_file(output, force, chosen.mark, format_name)
    contents: dict[Path, bytes] = {}
    made: list[Path] = []
    for output, source in outputs.items():
        for path, content in _contents(source, output, chosen, options, progress).items():
            made.append(path)
            if path in outputs or _check_beside(path, content, force, chosen):
                contents[path] = content
    stale = _stale(outputs, made, format_name, force)
    with whole_files(folder) as unfinished:
        for path, content in contents.items():
            (unfinished / path.name).write_bytes(content)
    for path in stale:
        remove_stale(path)
    return made


def _check_options(format_name: str, options: MotionOptions) -> None:
    heeded = FORMATS[format_name].options
    if unheeded := [option for option in options.given if option not in heeded]:
        able = [name for name, form in FORMATS.items() if set(unheeded) <= form.options]
        flags = ", ".join(f"--{option}" for option in unheeded)
        raise SettingsError(
            f"{flags} says nothing to {format_name}"
            f"{'; ' + ', '.join(able) + (' heeds' if len(able) == 1 else ' heed') + ' it' if able else ''}"
        )


def _contents(
    source: Path, output: Path, chosen: Format, options: MotionOptions, progress: Progress
) -> dict[Path, bytes]:
    made = chosen.content(source, options, progress)
    places = {suffix: output.with_suffix(suffix) if suffix else output for suffix in made}
    if len(set(places.values())) < len(places):
        twice = next(path for path, count in Counter(places.values()).items() if count > 1)
        raise OutputError(f"{twice}: would be two of the files to write; choose another name, or rename the segments")
    return {
        places[suffix]: content.encode() if isinstance(content, str) else content for suffix, content in made.items()
    }


def _stale(outputs: Iterable[Path], made: Collection[Path], format_name: str, force: bool) -> list[Path]:
    """Loops of URDFs that are replaced by some without."""
    if not force or format_name != "urdf":
        return []
    return [path for output in outputs if (path := stale_loops(output, made)) is not None]


def _check_beside(path: Path, content: bytes, force: bool, chosen: Format) -> bool:
    """Whether a file beside the main one is to be written: one that is there already, and the same, is left."""
    if path.is_file() and path.stat().st_size == len(content) and path.read_bytes() == content:
        return False
    mark, what = next(beside for end, beside in chosen.beside.items() if path.name.endswith(end))
    check_file(path, force, mark, what)
    return True


def _named_apart(sources: Sequence[Path]) -> Mapping[str, Path]:
    """Name -> source; as many of its folders go into the name as tell all apart."""
    places = [source.resolve().with_name(plain_name(source)) for source in sources]
    for length in range(1, 1 + max(len(place.parts) for place in places)):
        names = ["_".join(place.parts[1:][-length:]) for place in places]
        if len(set(names)) == len(names):
            return dict(zip(names, sources, strict=True))
    raise OutputError(f"{', '.join(map(str, sources))}: the same recording is given twice; give each once")
