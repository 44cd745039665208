"""Functions that the page of equations names exist, in the files that it names."""

import re
from pathlib import Path

REPOSITORY = Path(__file__).parents[2]
PAGE = (REPOSITORY / "docs/equations.md").read_text()
PACKAGE = REPOSITORY / "bodycam_ros"


def test_named_functions_exist() -> None:
    file, named = None, 0
    for word in re.findall(r"`([^`]+)`", PAGE):
        if word.endswith(".py"):
            file = PACKAGE / word
            assert file.is_file(), word
        elif word.endswith("/"):
            assert (PACKAGE / word).is_dir(), word
        else:
            assert file is not None, word
            assert re.search(rf"^ *(?:def|class) {word}\b", file.read_text(), re.MULTILINE), f"{file.name}: {word}"
            named += 1
    assert named > 20


def test_every_equation_of_both_papers_is_there() -> None:
    for section, last in zip(re.split(r"^## [AB]: ", PAGE, flags=re.MULTILINE)[1:], (17, 19), strict=True):
        found = set[int]()
        for cell in re.findall(r"^\| (\d[^|]*) \|", section, re.MULTILINE):
            numbers = [int(each) for each in re.findall(r"\d+", cell)]
            found |= set(range(numbers[0], numbers[-1] + 1)) if "to" in cell else set(numbers)
        assert found == set(range(1, last + 1))
