"""The page of a report, read back: contents, pictures beside their tables, and texts that are no markup."""

import re
from pathlib import Path

import pytest

from bodycam_ros.evaluate.evaluation import evaluate
from bodycam_ros.evaluate.report import write_report
from bodycam_ros.evaluate.sections import Section, column_table, render_page

HOSTILE = "<script>window.ran=1</script>\"' onload=x **b**"


def test_each_entry_of_the_contents_leads_to_its_heading(solved: Path, truth: Path, tmp_path: Path) -> None:
    write_report(evaluate(solved, truth), tmp_path / "report")
    page = (tmp_path / "report" / "report.html").read_text()
    links = re.findall(r'<a href="#([^"]+)">([^<]+)</a>', page)
    headings = re.findall(r'<h2 id="([^"]+)">([^<]+)</h2>', page)
    assert len(links) > 3 and links == headings
    pictures = [path for path in (tmp_path / "report").iterdir() if path.suffix == ".png"]
    assert page.count("<img ") == len(pictures) >= 2
    after_table = page.split("joints against the truth: position [cm]</h2>")[1].split("<h2")[0]
    assert "Error of each joint" in after_table, "the picture stands beside the table that it explains"


def test_texts_from_files_are_no_markup() -> None:
    table = column_table(HOSTILE, HOSTILE, [(HOSTILE, "x", "d")], {HOSTILE: {"x": 1}}, HOSTILE)
    page = render_page(HOSTILE, [HOSTILE], [table, Section(HOSTILE, warnings=[HOSTILE])])
    assert "<script" not in page and HOSTILE not in page
    assert page.count("&lt;script&gt;") == 12 and not re.search(r'="[^"]*<', page)


@pytest.mark.parametrize(("x", "note"), [(1.0, "a: first; b: second"), (None, "b: second")])
def test_a_note_has_the_columns_that_are_shown(x: float | None, note: str) -> None:
    columns = [("a [mm]", "x", ".0f"), ("b", "y", ".0f")]
    section = column_table("t", "n", columns, {"row": {"x": x, "y": 2.0}}, {"a": "first", "b": "second"})
    assert section.notes == (note,)
