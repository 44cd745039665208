"""What must hold of a state that is released; every rule gives a sentence for each thing that does not."""

import re
from collections.abc import Iterable, Mapping
from datetime import date
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

LARGEST_FILE_MB, LARGEST_BAGS_MB = 20.0, 40.0
MB = 2**20
NOT_LOCKED = {"setuptools", "wheel"}
"""Of requirements.txt, what only installs."""

_RELEASE = re.compile(r"^## \[(?P<version>[^\]]+)\](?: - (?P<date>\S+))?$", re.MULTILINE)
_PINNED = re.compile(r"^(?P<name>[\w.-]+)(?:\[[\w,.-]+\])?==(?P<version>[^\s;\\]+)", re.MULTILINE)


def stated_versions(sources: Path) -> dict[str, str]:
    """File -> the version that it states."""
    package = (sources / "bodycam_ros/__init__.py").read_text()
    stated = {"bodycam_ros/__init__.py": "".join(re.findall(r'^__version__ = "([^"]+)"$', package, re.MULTILINE))}
    for manifest in ("package.xml", "msg_defs/package.xml"):
        stated[manifest] = ElementTree.parse(sources / manifest).findtext("version") or ""
    return stated


def versions(stated: Mapping[str, str]) -> list[str]:
    """One version everywhere, of three numbers."""
    first = next(iter(stated.values()))
    wrong = [f"{place} says version {version}, others {first}" for place, version in stated.items() if version != first]
    return wrong if re.fullmatch(r"\d+\.\d+\.\d+", first) else [f"version {first}: three numbers are expected", *wrong]


def changelog(text: str, version: str, today: date) -> list[str]:
    """The newest entry is of this version and has its date, nothing is left under Unreleased, and versions fall."""
    entries = [(found["version"], found["date"], found.end()) for found in _RELEASE.finditer(text)]
    ends = [found.start() for found in _RELEASE.finditer(text)][1:] + [len(text)]
    texts = {name: text[start:end].strip() for (name, _, start), end in zip(entries, ends, strict=True)}
    released = [(name, said) for name, said, _ in entries if name != "Unreleased"]
    faults = ["CHANGELOG.md: entries are left under Unreleased"] if texts.get("Unreleased") else []
    if not released or released[0][0] != version:
        return [*faults, f"CHANGELOG.md: its first entry must be '## [{version}] - {today}'"]
    if not texts[version]:
        faults.append(f"CHANGELOG.md: the entry of {version} says nothing")
    for name, said in released:
        try:
            if date.fromisoformat(said or "") > today:
                faults.append(f"CHANGELOG.md: {name} is dated {said}, after today")
        except ValueError:
            faults.append(f"CHANGELOG.md: {name} has no date, as in '## [{name}] - {today}'")
    numbers = [tuple(map(int, re.findall(r"\d+", name))) for name, _ in released]
    if any(newer <= older for newer, older in pairwise(numbers)):
        faults.append("CHANGELOG.md: versions are not in falling order")
    return faults


def sizes(bytes_of: Mapping[str, int]) -> list[str]:
    """No file is too large, nor all recordings together.

    Args:
        bytes_of: path beneath the repository -> its size.
    """
    faults = [
        f"{path} has {size / MB:.1f} MB; a file may have {LARGEST_FILE_MB:g}"
        for path, size in bytes_of.items()
        if size > LARGEST_FILE_MB * MB
    ]
    bags = sum(size for path, size in bytes_of.items() if path.startswith("bags/")) / MB
    return faults if bags <= LARGEST_BAGS_MB else [*faults, f"bags/ has {bags:.1f} MB; it may have {LARGEST_BAGS_MB:g}"]


def lock(requirements: str, locked: str | None, name: str) -> list[str]:
    """What is installed is locked at the versions that are asked for, each with a hash.

    Args:
        requirements: text of the pinned list.
        locked: text of the lock, as ``pip install --require-hashes`` reads it; None if there is none.
        name: of the lock.
    """
    if locked is None:
        return [f"there is no {name}; make lock writes it"]
    entries = list(_PINNED.finditer(locked))
    ends = [*(found.start() for found in entries), len(locked)][1:]
    versions_of: dict[str, set[str]] = {}
    for found in entries:
        versions_of.setdefault(_key(found["name"]), set()).add(found["version"])
    faults = []
    for asked in _PINNED.finditer(requirements):
        if (key := _key(asked["name"])) in NOT_LOCKED:
            continue
        if key not in versions_of:
            faults.append(f"{name} lacks {key}")
        elif asked["version"] not in versions_of[key]:
            there = ", ".join(sorted(versions_of[key]))
            faults.append(f"{name} has {key} {there}; {asked['version']} is asked for")
    return faults + [
        f"{name} has no hash for {_key(found['name'])}"
        for found, end in zip(entries, ends, strict=True)
        if "sha256:" not in locked[found.end() : end]
    ]


def built(names: Iterable[str], version: str) -> list[str]:
    """The archive and both wheels, of this version and nothing else."""
    found = sorted(names)
    expected = (rf"bodycam_ros-{version}\.tar\.gz", rf"bodycam_(ros|msgs)-{version}-\S+\.whl")
    strange = [name for name in found if not any(re.fullmatch(pattern, name) for pattern in expected)]
    missing = [
        what
        for what, pattern in {
            "the archive of the sources": expected[0],
            "the wheel of the package": rf"bodycam_ros-{version}-\S+\.whl",
            "the wheel of its messages": rf"bodycam_msgs-{version}-\S+\.whl",
        }.items()
        if not any(re.fullmatch(pattern, name) for name in found)
    ]
    return [f"dist/{name} is not of {version}" for name in strange] + [f"dist/ lacks {what}" for what in missing]


def _key(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()
