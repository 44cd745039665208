"""The files that a step reads, in folders as they are found: with links, pipes, and links that lead nowhere."""

import os
from pathlib import Path


def files_in(path: Path) -> list[Path]:
    """A file, or all files in a folder, in the order of their names.

    Links are followed, each folder is read once, and what is no file, or cannot be found, is left out.
    """
    if not path.is_dir():
        return [path]
    files: list[Path] = []
    seen: set[str] = set()
    for root, folders, names in os.walk(path, followlinks=True):
        if (real := os.path.realpath(root)) in seen:
            folders.clear()
            continue
        seen.add(real)
        folders.sort()
        files += [file for name in names if (file := Path(root, name)).is_file()]
    return sorted(files)
