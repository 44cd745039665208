"""DDS itself holds participants to our keys.

The wheels' Fast DDS has no security; the one of Debian and Ubuntu has (apt install libfastrtps-dev), so the test speaks
to that.
"""

import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from secured.conftest import Keys

from bodycam_ros.secured.access import Access
from bodycam_ros.secured.keystore import make_keystore

_HEADER = "fastdds/dds/domain/DomainParticipant.hpp"
_TOPIC = "rt/left/tracks"
_SECONDS = 4


@pytest.fixture(scope="module")
def probe(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A participant of DDS, made for this."""
    folders = [*os.environ.get("CPLUS_INCLUDE_PATH", "").split(os.pathsep), "/usr/include"]
    if not any((Path(folder) / _HEADER).is_file() for folder in folders if folder) or not shutil.which("g++"):
        pytest.skip("no Fast DDS with security to compile for; on Debian and Ubuntu: apt install libfastrtps-dev g++")
    made = tmp_path_factory.mktemp("probe") / "probe"
    source = Path(__file__).parent / "dds_probe.cpp"
    words = ["g++", "-std=c++17", "-O0", str(source), "-o", str(made), "-lfastrtps", "-lfastcdr"]
    subprocess.run(words, check=True)
    return made


@pytest.fixture(scope="module")
def domain() -> Iterator[int]:
    pytest.importorskip("rclpy", reason="rclpy is not installed; 'make test' installs it")
    from own_domain import own_domain

    with own_domain() as domain:
        yield domain


def test_who_has_no_key_neither_hears_nor_is_heard(probe: Path, domain: int, keys: Keys, tmp_path: Path) -> None:
    ours, others = tmp_path / "ours", tmp_path / "others"
    make_keystore(ours, keys.enclaves, domain)
    make_keystore(others, {"/tracker_left": Access(frozenset({"/left/tracks"}))}, domain)
    forged = tmp_path / "forged"
    shutil.copytree(ours / "enclaves/tracker_left", forged)
    for name in ("permissions.p7s", "permissions_ca.cert.pem"):
        shutil.copy(others / "enclaves/tracker_left" / name, forged / name)

    def start(name: str, folder: Path | str, deed: str, in_domain: int = domain) -> "subprocess.Popen[str]":
        words = [str(probe), name, str(folder), str(in_domain), deed, _TOPIC, str(_SECONDS)]
        return subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)

    started = {
        "registration": start("registration", ours / "enclaves/registration_1", "hear"),
        "observer": start("observer", ours / "enclaves/observer", "hear"),
        "wrong registration": start("wrong registration", ours / "enclaves/registration_2", "hear"),
        "ear": start("ear", "-", "hear"),
        "tracker": start("tracker", ours / "enclaves/tracker_left", "say"),
        "wrong tracker": start("wrong tracker", ours / "enclaves/tracker_right", "say"),
        "mouth": start("mouth", "-", "say"),
        "stranger": start("stranger", others / "enclaves/tracker_left", "say"),
        "forger": start("forger", forged, "say"),
        "wrong domain": start("wrong domain", ours / "enclaves/tracker_left", "say", domain + 1),
    }
    # Fast DDS says there, too, what it does not like.
    words = {"denied", "refused", *started}
    told = {name: words & set(each.communicate(timeout=60)[0].splitlines()) for name, each in started.items()}
    assert told["registration"] == told["observer"] == {"tracker"}
    assert told["ear"] == {"mouth"}
    assert told["wrong registration"] == told["wrong tracker"] == {"denied"}
    assert told["wrong domain"] == {"denied"}
    assert told["forger"] == {"refused"}
    assert not told["tracker"] | told["mouth"] | told["stranger"], "they may speak, if only among themselves"
