"""What must hold of a release: each rule is broken once, and says so."""

import subprocess
from datetime import date
from pathlib import Path

import pytest
from release_check import faults
from release_rules import LARGEST_BAGS_MB, LARGEST_FILE_MB, MB, built, changelog, lock, sizes, stated_versions, versions

import bodycam_ros

REPOSITORY = Path(__file__).parents[2]
TODAY = date(2030, 5, 17)
LOG = """# Changelog

## [Unreleased]

## [1.10.0] - 2030-05-17

- New.

## [1.9.0] - 2029-01-01

- Old.
"""
LOCK = """# made by a tool
av==18.1.0 \\
    --hash=sha256:00aa \\
    --hash=sha256:11bb
ruamel.yaml==0.19.1 ; python_version >= "3.11" \\
    --hash=sha256:22cc
"""
DIST = (
    "bodycam_ros-1.2.3.tar.gz",
    "bodycam_ros-1.2.3-py3-none-any.whl",
    "bodycam_msgs-1.2.3-cp312-cp312-linux_x86_64.whl",
)


def test_versions_agree() -> None:
    assert versions({"a": "1.2.3", "b": "1.2.3"}) == []
    assert versions({"a": "1.2.3", "b": "1.2.4"}) == ["b says version 1.2.4, others 1.2.3"]
    assert len(versions({"a": "1.2.dev0", "b": "1.2.dev0"})) == 1
    stated = stated_versions(REPOSITORY)
    assert set(stated.values()) == {bodycam_ros.__version__} and len(stated) == 3


def test_a_changelog_that_is_ready() -> None:
    assert changelog(LOG, "1.10.0", TODAY) == []


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ("## [Unreleased]\n", "## [Unreleased]\n\n- Late.\n", "left under Unreleased"),
        ("## [1.10.0] - 2030-05-17\n\n- New.\n", "", "must be '## [1.10.0] - 2030-05-17'"),
        (" - 2030-05-17", "", "1.10.0 has no date"),
        ("2030-05-17", "2030-05-18", "after today"),
        ("2029-01-01", "soon", "1.9.0 has no date"),
        ("- New.", "", "says nothing"),
        ("[1.9.0]", "[1.10.1]", "falling order"),
    ],
)
def test_a_changelog_that_is_not(before: str, after: str, said: str) -> None:
    assert before in LOG
    found = changelog(LOG.replace(before, after), "1.10.0", TODAY)
    assert len(found) == 1 and said in found[0]


def test_sizes() -> None:
    largest, half = int(LARGEST_FILE_MB * MB), int(LARGEST_BAGS_MB * MB / 2)
    assert sizes({"docs/a.png": largest, "bags/a": half, "bags/b": half}) == []
    assert "docs/a.png has 20.0 MB" in sizes({"docs/a.png": largest + 1})[0]
    assert "bags/ has 40.0 MB" in sizes({"bags/a": half, "bags/b": half, "bags/c": 1})[0]


def test_the_lock() -> None:
    asked = "# what runs\nav==18.1.0\nruamel_yaml[old]==0.19.1\nwheel==1.0\n"
    assert lock(asked, LOCK, "lock.txt") == []
    assert lock(asked, None, "lock.txt") == ["there is no lock.txt; make lock writes it"]
    assert lock("numba==0.68.1\n", LOCK, "lock.txt") == ["lock.txt lacks numba"]
    assert lock("av==18.2.0\n", LOCK, "lock.txt") == ["lock.txt has av 18.1.0; 18.2.0 is asked for"]
    without = LOCK.replace("    --hash=sha256:22cc\n", "")
    assert lock(asked, without, "lock.txt") == ["lock.txt has no hash for ruamel-yaml"]
    for_two_pythons = LOCK + 'av==17.0.0 ; python_version < "3.11" \\\n    --hash=sha256:33dd\n'
    assert lock(asked, for_two_pythons, "lock.txt") == []


def test_what_was_built() -> None:
    assert built(DIST, "1.2.3") == []
    assert built(DIST[:2], "1.2.3") == ["dist/ lacks the wheel of its messages"]
    assert len(built(DIST, "1.2.4")) == 6
    assert built((*DIST, "notes.txt"), "1.2.3") == ["dist/notes.txt is not of 1.2.3"]


def test_all_of_it_on_a_repository(tmp_path: Path) -> None:
    """A small one, from which the version is asked as from the real one."""
    for path, text in {
        "bodycam_ros/__init__.py": '__version__ = "1.10.0"\n',
        "bodycam_ros/cli/__init__.py": "",
        "bodycam_ros/cli/main.py": 'print("bodycam 1.10.0")\n',
        "package.xml": "<package><version>1.10.0</version></package>",
        "msg_defs/package.xml": "<package><version>1.10.0</version></package>",
        "CHANGELOG.md": LOG.replace("2030-05-17", "2020-05-17").replace("2029-01-01", "2019-01-01"),
        "requirements.txt": "av==18.1.0\n",
        "lock.txt": LOCK,
        "requirements-ros.txt": "ruamel.yaml==0.19.1\n",
        "lock_ros.txt": LOCK,
        ".gitignore": "dist/\n__pycache__/\n",
    }.items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text)
    (tmp_path / "dist").mkdir()
    for name in DIST:
        (tmp_path / "dist" / name.replace("1.2.3", "1.10.0")).touch()
    git = ["git", "-c", "user.name=A", "-c", "user.email=a@example.org"]
    for words in (["init", "-q"], ["add", "-A"], ["commit", "-qm", "All"]):
        subprocess.run([*git, *words], cwd=tmp_path, check=True, capture_output=True)
    assert list(faults(tmp_path, tmp_path / "dist")) == []

    (tmp_path / "package.xml").write_text("<package><version>1.9.0</version></package>")
    (tmp_path / "lock.txt").unlink()
    assert list(faults(tmp_path, tmp_path / "dist")) == [
        "package.xml says version 1.9.0, others 1.10.0",
        "lock.txt is not committed",
        "package.xml is not committed",
        "there is no lock.txt; make lock writes it",
    ]
