"""The locks hold what is asked for, at the versions of the constraints, each with the hashes of its files."""

import re
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parent.parent
LOCKS = {"lock.txt": "requirements.txt", "lock_ros.txt": "requirements-ros.txt"}
_PINNED = re.compile(r"^([\w.-]+)(?:\[[\w,]+\])?==([^\s;\\]+)")


def pinned(path: Path) -> dict[str, str]:
    """Package, as indices spell it -> version."""
    found = (_PINNED.match(line) for line in path.read_text().splitlines())
    return {re.sub(r"[-_.]+", "-", match[1]).lower(): match[2] for match in found if match}


@pytest.mark.parametrize("lock, requirements", LOCKS.items())
def test_a_lock_has_what_is_asked_for(lock: str, requirements: str) -> None:
    locked, asked = pinned(REPOSITORY / lock), pinned(REPOSITORY / requirements)
    assert asked and asked.items() <= locked.items(), "run make lock"


@pytest.mark.parametrize("lock", LOCKS)
def test_a_lock_has_the_versions_that_are_tested(lock: str) -> None:
    locked, tested = pinned(REPOSITORY / lock), pinned(REPOSITORY / "constraints.txt")
    # What other systems than ours need is not installed here.
    only_elsewhere = {name for name in locked if name not in tested}
    assert {name: locked[name] for name in locked.keys() - only_elsewhere} == {
        name: tested[name] for name in locked.keys() - only_elsewhere
    }
    entries = re.split(r"\n(?=\S)", (REPOSITORY / lock).read_text().strip())
    assert {entry.split("==")[0] for entry in entries if entry.split("==")[0] in only_elsewhere} == only_elsewhere
    assert not [entry for entry in entries if entry.split("==")[0] in only_elsewhere and " ; " not in entry]


@pytest.mark.parametrize("lock", LOCKS)
def test_every_package_has_hashes(lock: str) -> None:
    entries = re.split(r"\n(?=\S)", (REPOSITORY / lock).read_text().strip())
    assert len(entries) == len(pinned(REPOSITORY / lock))
    assert not [entry for entry in entries if not re.search(r"--hash=sha256:[0-9a-f]{64}\b", entry)]
