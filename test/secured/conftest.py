"""The keys of a small graph."""

from dataclasses import dataclass
from pathlib import Path

import pytest
from two_cameras import write_body

from bodycam_ros.nodes.graph import NodeProcess, live_graph, player
from bodycam_ros.secured.access import Access
from bodycam_ros.secured.enclaves import enclaves_of
from bodycam_ros.secured.keystore import make_keystore

DOMAIN = 7


@dataclass(frozen=True)
class Keys:
    """A keystore, and what it was made of."""

    folder: Path
    enclaves: dict[str, Access]

    def of(self, enclave: str) -> Path:
        return self.folder / "enclaves" / enclave


def small_graph(folder: Path) -> list[NodeProcess]:
    nodes = live_graph(folder / "map", write_body(folder / "body.yaml"), registrations=2)
    return [*nodes, NodeProcess("retarget", "retarget"), player(folder / "bag", 1.0)]


@pytest.fixture(scope="session")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Keys:
    folder = tmp_path_factory.mktemp("keys")
    enclaves = enclaves_of(small_graph(folder))
    make_keystore(folder / "keystore", enclaves, DOMAIN)
    return Keys(folder / "keystore", enclaves)
