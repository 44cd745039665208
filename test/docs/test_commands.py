"""Commands in the documentation are understood, and those that are marked so do what they should on the sample."""

import re
import subprocess
from pathlib import Path

import pytest
from helpers.doc_blocks import DocBlock, doc_blocks, doc_files

from bodycam_ros.cli import main as command_line
from bodycam_ros.cli.settings import all_groups, all_settings_yaml
from bodycam_ros.graph.declared_graph import GraphArguments
from bodycam_ros.graph.node_parameters import OF_NODES, help_text
from bodycam_ros.settings import describe

REPOSITORY = Path(__file__).parents[2]
DOCS = REPOSITORY / "docs"
BLOCKS = doc_blocks(DOCS)
OF_OTHERS = {"make", "git", "colcon", "ros2"}


def by_page(block: DocBlock) -> str:
    return block.page


def is_understood(words: list[str]) -> bool:
    joined = command_line.join_command(words[1:])
    try:
        command_line.make_parser(joined).parse_args(joined)
    except SystemExit:
        return False
    return True


@pytest.mark.parametrize("block", [b for b in BLOCKS if b.language == "sh"], ids=by_page)
def test_commands_are_understood(block: DocBlock) -> None:
    for words in block.commands:
        assert words[0] in OF_OTHERS or words[0] == "bodycam", words
        assert words[0] != "bodycam" or is_understood(words), " ".join(words)


@pytest.mark.long
@pytest.mark.parametrize("block", [b for b in BLOCKS if b.is_run], ids=by_page)
def test_what_is_marked_runs(
    block: DocBlock,
    sample_out: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "bags").symlink_to(REPOSITORY / "bags")
    (tmp_path / "out").mkdir()
    (tmp_path / "out/demo").symlink_to(sample_out)
    for name, text in doc_files(DOCS).items():
        (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)
    if block.language == "python":
        exec(compile(block.text, block.page, "exec"), {})
        lines = 1 if "iter_metadata" in block.text else 60  # what the sample was made from; else one for each instant
        assert len(capfd.readouterr().out.splitlines()) == lines
        return
    for words in block.commands:
        assert command_line.main(words[1:]) == 0, f"{' '.join(words)}\n{capfd.readouterr().err}"
        if "-o" in words:
            assert Path(words[words.index("-o") + 1]).exists()


def test_make_alone_lists_what_there_is() -> None:
    listed = subprocess.run(["make", "-s", "-C", REPOSITORY], capture_output=True, text=True, check=True).stdout
    targets = re.search(r"^\.PHONY: (.*)$", (REPOSITORY / "Makefile").read_text(), re.MULTILINE)
    assert targets is not None
    assert {*re.findall(r"^make (\S+)", listed, re.MULTILINE)} == {*targets[1].split()} - {"help"}


def test_launch_arguments_are_known() -> None:
    launch_file = (REPOSITORY / "launch/bodycam.launch.py").read_text()
    declared = {*re.findall(r'DeclareLaunchArgument\(\s*"(\w+)"', launch_file)}
    declared |= {each.name for each in describe(GraphArguments)}
    of_nodes = {each.name for parameters in OF_NODES.values() for each in describe(parameters)}
    used = {match for path in DOCS.glob("*.md") for match in re.findall(r"\b([a-z]\w*):=", path.read_text())}
    assert {"stations", "urdf"} <= used
    of_ros = {"__ns", "__node"}
    assert used <= declared | of_nodes | of_ros


def test_the_file_of_all_settings_has_the_defaults_of_now() -> None:
    assert (REPOSITORY / "config/all_settings.yaml").read_text() == all_settings_yaml()


def test_settings_that_are_named_exist() -> None:
    texts = [*(path.read_text() for path in DOCS.glob("*.md")), *map(help_text, OF_NODES)]
    known = {f"{group}.{each.name}" for group, kind in all_groups().items() for each in describe(kind)}
    flags = {name for text in texts for name in re.findall(r"--(\w+\.\w+)", text)}
    groups = "|".join(all_groups())
    named = {name for text in texts for name in re.findall(rf"(?<![\w/])(?:{groups}|tracker)\.(?!py|md|yaml)\w+", text)}
    assert len(flags | named) > 5
    assert (flags | named) - known == set()


def test_configurations_that_are_named_exist() -> None:
    sources = [*(REPOSITORY / "launch").glob("*.py"), *DOCS.glob("*.md"), REPOSITORY / "README.md"]
    named = {name for source in sources for name in re.findall(r"\bconfig/\w[\w/.-]*\w", source.read_text())}
    assert {"config/all_settings.yaml", "config/fastdds-shm.xml"} <= named
    assert {name for name in named if not (REPOSITORY / name).exists()} == set()


def test_every_command_has_its_place_in_the_pages() -> None:
    text = " ".join(path.read_text() for path in DOCS.glob("*.md"))
    assert [command for command in command_line.COMMANDS if f"bodycam {command}" not in text] == []
