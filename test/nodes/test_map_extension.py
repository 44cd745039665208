"""A registration's map is extended by a recording for the asking, beside its work."""

from pathlib import Path
from typing import Any

import pytest
from tiny_bag import write_tiny_bag
from two_cameras import write_map

from bodycam_ros.live.graph import GraphNode
from bodycam_ros.registration.reference_map import ReferenceMap

_PATIENCE_S = 120.0


@pytest.mark.long
def test_an_extension_says_how_far_it_is_and_can_be_called_off(graph: Any, sample: Path, tmp_path: Path) -> None:
    from action_msgs.msg import GoalStatus

    action = pytest.importorskip("bodycam_msgs.action", reason="bodycam_msgs was built before it had actions")
    given = {"map": str(write_map(tmp_path / "map")), "cameras": ["left"]}
    (registration,) = graph.run(GraphNode("registration", "registration", given))
    told: list[Any] = []
    output = tmp_path / "extended"

    def ask(recording: object) -> Any:
        told.clear()
        fields = {"recording": str(recording), "output": str(output)}
        return graph.send_goal("/registration/extend_map", action.ExtendMap, told.append, **fields)

    def result(goal: Any) -> Any:
        future = goal.get_result_async()
        graph.until(future.done, _PATIENCE_S, "it answers")
        return future.result()

    failed = result(ask(""))
    assert failed.status == GoalStatus.STATUS_ABORTED and "say which recording" in failed.result.message

    goal = ask(sample / "sample/bag")
    graph.until(lambda: any(each.step.startswith("round 1") for each in told), _PATIENCE_S, "it says how far it is")
    assert not ask(tmp_path / "another").accepted
    goal.cancel_goal_async()
    called_off = result(goal)
    assert called_off.status == GoalStatus.STATUS_CANCELED and "called off" in called_off.result.message
    assert not output.exists()

    # Grey images: nothing grows, and all is done soon.
    made = result(ask(write_tiny_bag(tmp_path / "bag")))
    assert made.status == GoalStatus.STATUS_SUCCEEDED and str(output) in made.result.message, made
    assert {each.step for each in told} >= {"round 1, forwards", "checking the coverage"}
    assert ReferenceMap.load(output).grown == 0
    assert registration.end() == 0
