"""Programs beside ``bodycam``: those that pages, notes and the Makefile name are there, and take what is named."""

import argparse
import re
import runpy
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

REPOSITORY = Path(__file__).parents[2]
_SOURCES = ("README.md", "Makefile", "docs/*.md", "docs/decisions/*.md", "benchmarks/*.md", "benchmarks/**/*.py")
_PROGRAM = re.compile(r"python -m (benchmarks(?:\.[a-z]\w*)+)([^\n`|<\"]*)")
_NUMBERS = {"--cameras": "2", "--rate": "0.5"}
"""Flags whose placeholder, a word of capitals, stands for a number."""

_TINY: dict[str, list[str]] = {
    "benchmarks.stage_timing": [],
    "benchmarks.latency": ["--cameras", "1", "--rate", "0.5", "--registrations", "1"],
    "benchmarks.endurance": ["--minutes", "0.05"],
    "benchmarks.bag_speed": [],
}
"""Program -> arguments that make its documented run a short one."""


@dataclass(frozen=True)
class Program:
    """A line that starts a program: where it is, the module, and the words after it."""

    source: str
    module: str
    words: tuple[str, ...]


def documented() -> list[Program]:
    found = {}
    for pattern in _SOURCES:
        for path in sorted(REPOSITORY.glob(pattern)):
            for module, rest in _PROGRAM.findall(path.read_text()):
                text = re.sub(r"\$\(if .*|\$\([^)]*\)|[\[\]]|\s+prints .*|\s+-->.*", "", rest).strip().rstrip(".:,;)")
                words = tuple(shlex.split(text.split("  ")[0]))
                found[module, words] = Program(path.name, module, words)
    return list(found.values())


PROGRAMS = documented()


class _UnderstoodError(Exception):
    """The words were parsed."""


def test_all_benchmarks_can_be_imported() -> None:
    """What one imports only when it has begun counts, too: a name that had gone ended ``make latency``."""
    modules = [
        ".".join(path.relative_to(REPOSITORY).with_suffix("").parts)
        for path in sorted((REPOSITORY / "benchmarks").rglob("*.py"))
        if path.name not in ("__init__.py", "__main__.py")
    ]
    assert len(modules) > 30
    program = f"import importlib\nfor name in {modules}: importlib.import_module(name)"
    run = subprocess.run([sys.executable, "-c", program], cwd=REPOSITORY, capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, run.stderr


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda each: f"{each.source}: {each.module} {' '.join(each.words)}")
def test_documented_arguments_are_understood(program: Program, monkeypatch: pytest.MonkeyPatch) -> None:
    path = REPOSITORY / Path(*program.module.split("."))
    file = path / "__main__.py" if path.is_dir() else path.with_suffix(".py")
    if "ArgumentParser" not in file.read_text():
        assert not program.words, f"{file} takes no arguments"
        return
    parse = argparse.ArgumentParser.parse_args

    def parse_only(self: Any, *given: Any, **named: Any) -> None:
        parse(self, *given, **named)
        raise _UnderstoodError

    words = list(program.words)
    for number, word in enumerate(words[1:], start=1):
        words[number] = _NUMBERS.get(words[number - 1], word) if word.isupper() else word
    monkeypatch.setattr(argparse.ArgumentParser, "parse_args", parse_only)
    monkeypatch.setattr(sys, "argv", [program.module, *words])
    with pytest.raises(_UnderstoodError):
        runpy.run_module(program.module, run_name="__main__", alter_sys=True)


@pytest.mark.long
@pytest.mark.parametrize("module", _TINY)
def test_programs_of_the_makefile_run(module: str) -> None:
    program = next(each for each in PROGRAMS if each.module == module and each.words[0] == "bags/sample/bag")
    command = [sys.executable, "-m", module, *program.words, *_TINY[module]]
    run = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, timeout=600)
    assert run.returncode == 0 and run.stdout.strip(), f"{' '.join(command)}\n{run.stdout}{run.stderr}"


@pytest.mark.long
def test_the_fault_campaign_begins_with_good_inputs() -> None:
    """All other cases prove nothing where good inputs are refused; its own test has the damaged ones."""
    command = [sys.executable, "test/faults", "--only", "intact"]
    run = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, timeout=900)
    assert run.returncode == 0, f"{run.stdout}{run.stderr}"
