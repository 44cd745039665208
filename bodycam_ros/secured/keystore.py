"""A folder of keys as ROS 2 looks for them (``ROS_SECURITY_KEYSTORE``), laid out as ROS 2's own tools do.

``private/`` has the authority's key, by which anything can be signed: it stays where it is made. A machine needs
``public/`` and the folders in ``enclaves/`` of what runs on it.
"""

import os
import re
import shutil
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from bodycam_ros.errors import AccessError, OutputError
from bodycam_ros.secured.access import Access
from bodycam_ros.secured.authority import Authority, Identity
from bodycam_ros.secured.permissions import governance, permissions, policy
from bodycam_ros.whole_file import failure_named, whole_folder

POLICY = "bodycam.policy.xml"

_AUTHORITY = "ca"
_ROLES = ("identity_ca", "permissions_ca")
_GOVERNANCE = "enclaves/governance"
_ENCLAVE = re.compile(r"(/[A-Za-z_]\w*)+", re.ASCII)
_SECRET, _SECRET_FOLDER = 0o600, 0o700
_NEEDED = (
    *(f"public/{role}.cert.pem" for role in _ROLES),
    *(f"private/{role}.key.pem" for role in _ROLES),
    f"{_GOVERNANCE}.p7s",
)


@dataclass(frozen=True)
class Made:
    """What became of a keystore.

    Attributes:
        new: enclaves with a new key.
        kept: enclaves whose key was there and is valid; their permissions are written anew.
        others: enclaves that are there, and that nobody asked for; they are as they were.
    """

    new: tuple[str, ...]
    kept: tuple[str, ...]
    others: tuple[str, ...]


def make_keystore(path: Path, enclaves: Mapping[str, Access], domain: int) -> Made:
    """Make a keystore, or bring one up to date: its authority and valid keys stay.

    Args:
        path: folder to be, or a keystore of ours or of ``ros2 security create_keystore``.
        enclaves: absolute name -> what its holder may do, with absolute names.
        domain: number of the DDS domain that it is for.

    Raises:
        AccessError: a name cannot be an enclave's, or the keystore that is there cannot sign.
        OutputError: it cannot be written, or what is there is no keystore.
    """
    if odd := [enclave for enclave in enclaves if not _ENCLAVE.fullmatch(enclave)]:
        raise AccessError(f"{odd[0]}: cannot be the name of an enclave: letters, digits, '_' and '/' alone")
    with whole_folder(path, _check_is_keystore) as unfinished, failure_named(path):
        if path.is_dir() and any(path.iterdir()):
            shutil.copytree(path, unfinished, symlinks=True)
            of_identities, of_permissions = (
                Authority.read(path / f"public/{role}.cert.pem", path / f"private/{role}.key.pem") for role in _ROLES
            )
        else:
            of_identities = of_permissions = _new_keystore(unfinished)
        _write_signed(unfinished / _GOVERNANCE, governance(domain), of_permissions)
        identities = {enclave: _identity(unfinished, enclave, of_identities) for enclave in enclaves}
        for enclave, (identity, _) in identities.items():
            rights = permissions(enclave, enclaves[enclave], domain, identity.begins, identity.ends)
            _write_signed(unfinished / "enclaves" / enclave[1:] / "permissions", rights, of_permissions)
        (unfinished / POLICY).write_bytes(policy(enclaves))
        there = {
            f"/{file.parent.relative_to(unfinished / 'enclaves')}" for file in unfinished.glob("enclaves/**/key.pem")
        }
    return Made(
        tuple(enclave for enclave, (_, is_new) in identities.items() if is_new),
        tuple(enclave for enclave, (_, is_new) in identities.items() if not is_new),
        tuple(sorted(there - set(enclaves))),
    )


def _check_is_keystore(path: Path) -> None:
    if path.is_dir() and not any(path.iterdir()):
        return
    if lacking := [name for name in _NEEDED if not (path / name).is_file()]:
        raise OutputError(
            f"{path}: is there, and is no keystore that could be added to (it has no {lacking[0]}); choose another name"
        )


def _new_keystore(path: Path) -> Authority:
    """The folders, and an authority of its own for who is who and who may what."""
    authority = Authority.new()
    for folder in ("enclaves", "public", "private"):
        (path / folder).mkdir(parents=True)
    (path / "private").chmod(_SECRET_FOLDER)
    (path / f"public/{_AUTHORITY}.cert.pem").write_bytes(authority.certificate)
    _write_secret(path / f"private/{_AUTHORITY}.key.pem", authority.key)
    for role in _ROLES:
        (path / f"public/{role}.cert.pem").symlink_to(f"{_AUTHORITY}.cert.pem")
        (path / f"private/{role}.key.pem").symlink_to(f"{_AUTHORITY}.key.pem")
    return authority


def _identity(keystore: Path, enclave: str, authority: Authority) -> tuple[Identity, bool]:
    """Who the enclave is, and whether that is new."""
    folder = keystore / "enclaves" / enclave[1:]
    folder.mkdir(parents=True, exist_ok=True)
    with suppress(OSError):
        known = authority.known(enclave, (folder / "cert.pem").read_bytes(), (folder / "key.pem").read_bytes())
        if known is not None:
            return known, False
    identity = authority.identity(enclave)
    _write_secret(folder / "key.pem", identity.key)
    (folder / "cert.pem").write_bytes(identity.certificate)
    for name, place in {f"{role}.cert.pem": "public" for role in _ROLES}.items() | {("governance.p7s", "enclaves")}:
        (folder / name).unlink(missing_ok=True)
        (folder / name).symlink_to(os.path.relpath(keystore / place / name, folder))
    return identity, True


def _write_signed(path: Path, document: bytes, authority: Authority) -> None:
    path.with_suffix(".xml").write_bytes(document)
    path.with_suffix(".p7s").write_bytes(authority.signed(document))


def _write_secret(path: Path, content: bytes) -> None:
    """Write what nobody else may read, not even while it is written."""
    path.unlink(missing_ok=True)
    with open(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, _SECRET), "wb") as file:
        file.write(content)
