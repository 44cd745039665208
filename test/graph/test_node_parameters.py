"""Parameters of the nodes: one file serves all of them, so what two nodes share has to be one thing."""

import pytest
from helpers.naming import names

from bodycam_ros.cli.settings import all_groups
from bodycam_ros.graph.node_parameters import (
    GROUPS,
    OF_NODES,
    REGISTRATION_GROUPS,
    SOLVER_GROUPS,
    TRACKER_GROUPS,
    help_text,
)
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.settings import describe


def test_a_parameter_of_several_nodes_has_one_type() -> None:
    types: dict[str, set[type]] = {}
    for parameters in OF_NODES.values():
        for each in describe(parameters):
            types.setdefault(each.name, set()).add(each.type)
    assert {name: kinds for name, kinds in types.items() if len(kinds) > 1} == {}


def test_no_parameter_of_a_node_has_the_name_of_a_group_of_its_settings() -> None:
    groups = {"tracker": TRACKER_GROUPS, "registration": REGISTRATION_GROUPS, "skeleton_solver": SOLVER_GROUPS}
    for node, its in groups.items():
        assert not {*its} & {each.name for each in describe(OF_NODES[node])}, node


def test_groups_of_nodes_are_those_of_the_pipeline() -> None:
    assert set(all_groups()) == GROUPS
    known = set(PipelineSettings.groups())
    for groups in (TRACKER_GROUPS, REGISTRATION_GROUPS, SOLVER_GROUPS):
        assert set(groups) <= known
        assert len(set(groups)) == len(groups)


@pytest.mark.parametrize("node", OF_NODES)
def test_help_has_every_parameter_with_its_default_and_reason(node: str) -> None:
    text = help_text(node)
    for each in describe(OF_NODES[node]):
        line = f"  {each.name} ({each.type.__name__}, {each.default!r})\n      {each.text()}"
        assert line in text
        assert names(text, node)
