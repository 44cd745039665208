"""May this state be released? Says what stands in the way, and ends with 1 then.

python release/release_check.py dist    (make release-check builds the pages and dist, and tries what is in it, first)
"""

import subprocess
import sys
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

from release_rules import built, changelog, lock, sizes, stated_versions, versions

SOURCES = Path(__file__).resolve().parent.parent
LOCKS = {"requirements.txt": "lock.txt", "requirements-ros.txt": "lock_ros.txt"}


def faults(sources: Path, dist: Path) -> Iterator[str]:
    """What stands in the way of releasing what is in a folder under git."""
    stated = stated_versions(sources)
    version = stated["bodycam_ros/__init__.py"]
    told = _said([sys.executable, "-m", "bodycam_ros.cli.main", "--version"], sources)
    yield from versions(stated | {"bodycam --version": told.split()[-1]})
    yield from changelog((sources / "CHANGELOG.md").read_text(), version, datetime.now(UTC).date())
    yield from (
        f"{line[3:]} is not committed" for line in _said(["git", "status", "--porcelain"], sources).splitlines()
    )
    tracked = _said(["git", "ls-files", "-z"], sources).split("\0")
    yield from sizes({path: (sources / path).stat().st_size for path in tracked if (sources / path).is_file()})
    for asked, locked in LOCKS.items():
        there = sources / locked
        yield from lock((sources / asked).read_text(), there.read_text() if there.is_file() else None, locked)
    yield from built((path.name for path in dist.glob("*")), version)


def _said(command: list[str], folder: Path) -> str:
    return subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True).stdout


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    found = list(faults(SOURCES, Path(sys.argv[1]).resolve()))
    for fault in found:
        print(f"not yet: {fault}")
    print("this state may be released" if not found else f"{len(found)} thing(s) to mend")
    sys.exit(bool(found))
