"""Keystores as ROS 2 reads them: layout, signatures, what the documents say, and bringing one up to date."""

import os
import shutil
import subprocess
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import pytest
from secured.conftest import DOMAIN, Keys
from two_cameras import write_body

from bodycam_ros.cli.main import main
from bodycam_ros.errors import AccessError, OutputError
from bodycam_ros.secured.access import Access
from bodycam_ros.secured.keystore import POLICY, make_keystore

_ENCLAVE_FILES = {
    "cert.pem", "key.pem", "governance.p7s", "identity_ca.cert.pem", "permissions.p7s", "permissions.xml",
    "permissions_ca.cert.pem",
}  # fmt: skip


def content(folder: Path) -> dict[str, bytes]:
    return {str(f.relative_to(folder)): f.read_bytes() for f in folder.rglob("*") if f.is_file()}


def openssl(*words: object) -> subprocess.CompletedProcess[str]:
    if shutil.which("openssl") is None:
        pytest.skip("openssl, which checks what was signed, is not installed")
    return subprocess.run(["openssl", *map(str, words)], capture_output=True, text=True)


def signed_text(document: Path, authority: Path) -> str | None:
    """The text that was signed; None if the signature is not the authority's."""
    done = openssl("smime", "-verify", "-text", "-in", document, "-CAfile", authority)
    return done.stdout.replace("\r\n", "\n") if done.returncode == 0 else None


def topics(permissions: Path, deed: str) -> list[str]:
    return [str(each.text) for each in ET.parse(permissions).iterfind(f".//allow_rule/{deed}/topics/topic")]


def test_it_is_laid_out_as_ros_looks_for_it(keys: Keys) -> None:
    assert {path.name for path in keys.folder.iterdir()} == {"enclaves", "private", "public", POLICY}
    for enclave in keys.enclaves:
        folder = keys.of(enclave[1:])
        assert {path.name for path in folder.iterdir()} == _ENCLAVE_FILES
        assert all(path.is_file() for path in folder.iterdir()), "a link leads nowhere"
        assert not [path for path in folder.iterdir() if path.is_symlink() and os.path.isabs(os.readlink(path))]


def test_what_is_secret_is_read_by_nobody_else(keys: Keys) -> None:
    secrets = [path for path in keys.folder.rglob("*.key.pem")] + list(keys.folder.rglob("key.pem"))
    assert len(secrets) == len(keys.enclaves) + 3
    assert all(path.stat().st_mode & 0o077 == 0 for path in secrets)
    assert (keys.folder / "private").stat().st_mode & 0o077 == 0


def test_all_is_signed_by_the_authority_and_nothing_else_is(keys: Keys, tmp_path: Path) -> None:
    authority = keys.folder / "public/permissions_ca.cert.pem"
    tracker = keys.of("tracker_left")
    assert signed_text(tracker / "permissions.p7s", authority) == (tracker / "permissions.xml").read_text()
    assert signed_text(keys.folder / "enclaves/governance.p7s", authority)
    verified = openssl("verify", "-CAfile", keys.folder / "public/identity_ca.cert.pem", tracker / "cert.pem")
    assert verified.returncode == 0, verified.stderr
    forged = tmp_path / "permissions.p7s"
    forged.write_bytes((tracker / "permissions.p7s").read_bytes().replace(b"rt/left/tracks", b"rt/rice/tracks"))
    assert signed_text(forged, authority) is None
    make_keystore(tmp_path / "others", {"/tracker_left": Access()}, DOMAIN)
    assert signed_text(tmp_path / "others/enclaves/tracker_left/permissions.p7s", authority) is None


def test_permissions_are_in_the_order_of_the_schema(keys: Keys) -> None:
    root = ET.parse(keys.of("skeleton_solver") / "permissions.xml").getroot()
    (grant,) = root.findall("permissions/grant")
    assert (root.tag, grant.get("name")) == ("dds", "/skeleton_solver")
    assert [part.tag for part in grant] == ["subject_name", "validity", "allow_rule", "default"]
    assert (grant.findtext("subject_name"), grant.findtext("default")) == ("CN=/skeleton_solver", "DENY")
    assert [part.tag for part in grant.find("validity")] == ["not_before", "not_after"]
    assert [part.tag for part in grant.find("allow_rule")] == ["domains", "publish", "subscribe"]
    assert [each.text for each in grant.iterfind("allow_rule/domains/id")] == [str(DOMAIN)]


def test_a_domain_admits_nobody_without_a_key(keys: Keys) -> None:
    rule = ET.parse(keys.folder / "enclaves/governance.xml").find("domain_access_rules/domain_rule")
    assert rule.findtext("domains/id") == str(DOMAIN)
    assert rule.findtext("allow_unauthenticated_participants") == "false"
    assert {rule.findtext(f"{what}_protection_kind") for what in ("discovery", "liveliness", "rtps")} == {"ENCRYPT"}
    of_topics = rule.find("topic_access_rules/topic_rule")
    assert of_topics.findtext("topic_expression") == "*"
    assert {part.text for part in of_topics} == {"*", "true", "ENCRYPT"}


def test_the_policy_for_ros_tools_says_the_same(keys: Keys) -> None:
    enclaves = ET.parse(keys.folder / POLICY).findall("enclaves/enclave")
    assert [each.get("path") for each in enclaves] == list(keys.enclaves)
    for enclave in enclaves:
        written = {"ros_discovery_info"}
        for names in enclave.find("profiles/profile"):
            pre, post = {"publish": ("rt", ""), "request": ("rq", "Request"), "reply": ("rr", "Reply")}.get(
                next(iter(names.attrib)), ("", "")
            )
            written |= {f"{pre}{name.text}{post}" for name in names if pre}
        assert sorted(written) == topics(keys.of(enclave.get("path")[1:]) / "permissions.xml", "publish")


def test_keys_stay_while_permissions_change(keys: Keys, tmp_path: Path) -> None:
    path = tmp_path / "keystore"
    shutil.copytree(keys.folder, path, symlinks=True)
    before = content(path)
    tracker = keys.enclaves["/tracker_left"]
    wider = {"/tracker_left": replace(tracker, publishes=tracker.publishes | {"/more"}), "/juggler": Access()}
    made = make_keystore(path, wider, DOMAIN)
    assert (made.new, made.kept) == (("/juggler",), ("/tracker_left",))
    assert set(made.others) == set(keys.enclaves) - {"/tracker_left"}
    after = content(path)
    changed = {name for name in before if before[name] != after[name]}
    own = {f"enclaves/tracker_left/permissions.{kind}" for kind in ("xml", "p7s")}
    assert changed >= own | {POLICY} and not [name for name in changed - own if not name.endswith(("p7s", POLICY))]
    assert "rt/more" in topics(path / "enclaves/tracker_left/permissions.xml", "publish")


def test_a_key_of_another_authority_is_made_anew(keys: Keys, tmp_path: Path) -> None:
    path = tmp_path / "keystore"
    make_keystore(path, {"/a": Access()}, DOMAIN)
    for name in ("cert.pem", "key.pem"):
        shutil.copy(keys.of("tracker_left") / name, path / "enclaves/a" / name)
    assert make_keystore(path, {"/a": Access()}, DOMAIN).new == ("/a",)
    verified = openssl("verify", "-CAfile", path / "public/identity_ca.cert.pem", path / "enclaves/a/cert.pem")
    assert verified.returncode == 0, verified.stderr


def test_identities_and_permissions_may_have_authorities_of_their_own(tmp_path: Path) -> None:
    path, other = tmp_path / "keystore", tmp_path / "other"
    make_keystore(path, {"/a": Access()}, DOMAIN)
    make_keystore(other, {"/a": Access()}, DOMAIN)
    for name in ("public/identity_ca.cert.pem", "private/identity_ca.key.pem"):
        (path / name).unlink()
        shutil.copy(other / name, path / name)
    assert make_keystore(path, {"/a": Access(), "/b": Access()}, DOMAIN).new == ("/a", "/b")
    for enclave in (path / "enclaves/a", path / "enclaves/b"):
        verified = openssl("verify", "-CAfile", path / "public/identity_ca.cert.pem", enclave / "cert.pem")
        assert verified.returncode == 0, verified.stderr
        assert signed_text(enclave / "permissions.p7s", path / "public/permissions_ca.cert.pem")


def test_what_is_no_keystore_stays_as_it_is(keys: Keys, tmp_path: Path) -> None:
    (tmp_path / "photographs").mkdir()
    (tmp_path / "photographs/a.jpg").write_text("a")
    with pytest.raises(OutputError, match=r"photographs: is there, and is no keystore"):
        make_keystore(tmp_path / "photographs", {"/a": Access()}, 0)
    assert content(tmp_path) == {"photographs/a.jpg": b"a"}
    path = tmp_path / "keystore"
    shutil.copytree(keys.folder, path, symlinks=True)
    (path / "private/ca.key.pem").write_text("lost")
    before = content(path)
    with pytest.raises(AccessError, match="no authority"):
        make_keystore(path, {"/a": Access()}, 0)
    assert content(path) == before


@pytest.mark.parametrize("name", ["a", "/", "/a b", "/../a", "/a/", "/é"])
def test_names_that_no_enclave_has(name: str, tmp_path: Path) -> None:
    with pytest.raises(AccessError, match="cannot be the name of an enclave"):
        make_keystore(tmp_path / "keystore", {name: Access()}, 0)
    assert not (tmp_path / "keystore").exists()


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    body = write_body(tmp_path / "body.yaml")
    monkeypatch.setenv("ROS_DOMAIN_ID", "9")
    words = ["keystore", "--body", str(body), "-o", str(tmp_path / "keystore"), "--namespace", "alice"]
    assert main(words) == 0
    shown = capsys.readouterr().out
    assert "/alice/tracker_left" in shown and "ROS_SECURITY_STRATEGY=Enforce" in shown
    permissions = tmp_path / "keystore/enclaves/alice/tracker_left/permissions.xml"
    assert "rt/alice/left/tracks" in topics(permissions, "publish")
    assert [each.text for each in ET.parse(permissions).iterfind(".//id")] == ["9"]
    assert main([*words, "--domain", "233"]) == 1
    assert "a number from 0 to 232, not '233'" in capsys.readouterr().err


def test_what_it_says_to_export_is_for_a_shell(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "")  # as ROS 2 takes it: none
    body, path = write_body(tmp_path / "body.yaml"), tmp_path / "my keys"
    assert main(["keystore", "--body", str(body), "-o", str(path)]) == 0
    assert f"export ROS_SECURITY_KEYSTORE='{path}' ROS_SECURITY_ENABLE=true" in capsys.readouterr().out
