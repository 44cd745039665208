"""Keys and certificates on NIST's curve P-256, and documents signed as S/MIME: DDS Security 1.1, 9.3."""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Self

from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    load_pem_private_key,
    pkcs7,
)

from bodycam_ros.errors import AccessError

_NAME = "sros2CA"
_VALID = timedelta(days=3650)
_CLOCKS_APART = timedelta(days=1)
"""On a machine whose clock is behind, a key that was made just now would not be valid yet."""


@dataclass(frozen=True)
class Identity:
    """Who somebody is.

    Attributes:
        certificate: PEM, with the authority's signature.
        key: PEM, not encrypted.
        begins, ends: when it holds, UTC.
    """

    certificate: bytes
    key: bytes
    begins: datetime
    ends: datetime


class Authority:
    """Signs identities and documents.

    Args:
        certificate, key: its own.
    """

    def __init__(self, certificate: x509.Certificate, key: ec.EllipticCurvePrivateKey) -> None:
        self._certificate, self._key = certificate, key

    @classmethod
    def new(cls) -> Self:
        """One that nobody knows yet."""
        key = ec.generate_private_key(ec.SECP256R1())
        return cls(_certificate(_named(_NAME), key, _named(_NAME), key), key)

    @classmethod
    def read(cls, certificate: Path, key: Path) -> Self:
        """The one whose files these are.

        Raises:
            AccessError: they cannot be read, or do not belong together.
        """
        try:
            known = x509.load_pem_x509_certificate(certificate.read_bytes())
            own = load_pem_private_key(key.read_bytes(), None)
        except (OSError, ValueError, TypeError) as error:
            raise AccessError(f"{certificate}, {key}: no authority that keys could be signed by: {error}") from error
        if not isinstance(own, ec.EllipticCurvePrivateKey) or own.public_key() != known.public_key():
            raise AccessError(f"{key}: is not the key of {certificate}")
        return cls(known, own)

    @property
    def certificate(self) -> bytes:
        """PEM, for everybody."""
        return self._certificate.public_bytes(Encoding.PEM)

    @property
    def key(self) -> bytes:
        """PEM, not encrypted: who has it can sign."""
        return _key_text(self._key)

    def identity(self, name: str) -> Identity:
        """A new key for somebody of this name, with a certificate."""
        key = ec.generate_private_key(ec.SECP256R1())
        certificate = _certificate(_named(name), key, self._certificate.subject, self._key)
        return Identity(certificate.public_bytes(Encoding.PEM), _key_text(key), *_validity(certificate))

    def known(self, name: str, certificate: bytes, key: bytes) -> Identity | None:
        """An identity that was made before; None where it is no longer valid, another's, or of another authority."""
        try:
            read = x509.load_pem_x509_certificate(certificate)
            read.verify_directly_issued_by(self._certificate)
            own = load_pem_private_key(key, None)
        except (ValueError, TypeError, InvalidSignature):
            return None
        begins, ends = _validity(read)
        is_valid = begins <= datetime.now(UTC) < ends
        is_his = read.subject == _named(name) and own.public_key() == read.public_key()
        return Identity(certificate, key, begins, ends) if is_valid and is_his else None

    def signed(self, document: bytes) -> bytes:
        """A document in clear text with the signature below it, S/MIME."""
        builder = pkcs7.PKCS7SignatureBuilder().set_data(document)
        signing = builder.add_signer(self._certificate, self._key, hashes.SHA256())
        return signing.sign(Encoding.SMIME, [pkcs7.PKCS7Options.Text, pkcs7.PKCS7Options.DetachedSignature])


def _certificate(
    name: x509.Name, key: ec.EllipticCurvePrivateKey, issuer: x509.Name, issuer_key: ec.EllipticCurvePrivateKey
) -> x509.Certificate:
    is_authority = issuer_key is key
    now = datetime.now(UTC).replace(microsecond=0)
    limits = x509.BasicConstraints(ca=is_authority, path_length=1 if is_authority else None)
    return (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(issuer)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - _CLOCKS_APART)
        .not_valid_after(now + _VALID)
        .add_extension(limits, critical=is_authority)
        .sign(issuer_key, hashes.SHA256())
    )


def _named(name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, name)])


def _validity(certificate: x509.Certificate) -> tuple[datetime, datetime]:
    names = "not_valid_before", "not_valid_after"
    # Ubuntu 24.04 has cryptography 41, which has no times with a zone; later ones have no others.
    if hasattr(certificate, "not_valid_after_utc"):
        begins, ends = (getattr(certificate, f"{name}_utc") for name in names)
    else:
        begins, ends = (getattr(certificate, name).replace(tzinfo=UTC) for name in names)
    return begins, ends


def _key_text(key: ec.EllipticCurvePrivateKey) -> bytes:
    return key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
