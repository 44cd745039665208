"""A node that is to keep others out, and cannot, does not start; its last line says why."""

from pathlib import Path

import pytest
from secured.conftest import Keys

from bodycam_ros.nodes.graph import NodeProcess

_START_S = 60.0


def test_no_node_starts_unprotected_where_protection_is_asked_for(
    keys: Keys, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for package in ("rclpy", "bodycam_msgs"):
        pytest.importorskip(package, reason=f"{package} is not installed; 'make test' installs it")
    from live_graph import running_graph

    with running_graph(tmp_path) as graph:
        for name, value in {"ENABLE": "true", "STRATEGY": "Enforce", "KEYSTORE": str(keys.folder)}.items():
            monkeypatch.setenv(f"ROS_SECURITY_{name}", value)
        stranger, player = graph.start(
            NodeProcess("player", "stranger", {"bag": "nothing"}), NodeProcess("player", "player", {"bag": "nothing"})
        )
        assert (stranger.process.wait(_START_S), player.process.wait(_START_S)) == (1, 1)
    told = [refused.printed.splitlines()[-1] for refused in (stranger, player)]
    assert all(line.startswith("player: error: ") for line in told)
    assert "Traceback" not in stranger.printed + player.printed
    assert "keystore/enclaves/stranger' does not exist" in told[0]
    # The wheels' Fast DDS has no security; one that has takes the key, and there is no bag.
    assert "have the security libraries" in told[1] or "nothing" in told[1]
