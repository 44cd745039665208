"""The configuration of diagnostic_aggregator: every name that our nodes speak under falls to one analyzer."""

import re
from pathlib import Path

import pytest
import yaml

from bodycam_ros.nodes.start import NODES

CONFIG = Path(__file__).parent.parent / "config/diagnostic_aggregator.yaml"
HOLDS_OTHERS = {"graph"}
"""What runs nodes in its own process, and says nothing itself."""

OF_GENERIC_ANALYZER = {"type", "path", "regex", "timeout", "discard_stale"}


def analyzers() -> dict[str, dict[str, object]]:
    parameters = yaml.safe_load(CONFIG.read_text())["/**"]["ros__parameters"]
    return {name: value for name, value in parameters.items() if isinstance(value, dict)}


def analyzed_by(status: str) -> list[str]:
    """Whom a status falls to: its whole name must match, as with std::regex_match."""
    return [name for name, of in analyzers().items() if any(re.fullmatch(regex, status) for regex in of["regex"])]


def test_only_what_a_generic_analyzer_knows_is_said() -> None:
    for name, of in analyzers().items():
        assert of["type"] == "diagnostic_aggregator/GenericAnalyzer", name
        assert of.keys() <= OF_GENERIC_ANALYZER, name
    assert len({of["path"] for of in analyzers().values()}) == len(analyzers())


@pytest.mark.parametrize("node", sorted(set(NODES) - HOLDS_OTHERS))
def test_every_node_has_one_analyzer(node: str) -> None:
    names = [f"{space}{node}{number}" for space in ("", "anna/", "site_3/anna/") for number in ("", "_head", "_2")]
    parts = ("", ": camera head", ": all cameras", ": clock", ": equipment bicycle")
    assert {status: len(analyzed_by(status)) for name in names for part in parts if (status := name + part)} == {
        name + part: 1 for name in names for part in parts
    }


def test_trackers_of_static_cameras_are_no_others() -> None:
    assert analyzed_by("region_tracker_ext_00: camera ext_00") == ["static_cameras"]
    assert analyzed_by("tracker_head: camera head") == ["tracking"]


def test_nobody_else_is_analyzed() -> None:
    assert analyzed_by("base_driver: battery") == analyzed_by("my_player: disk") == []
