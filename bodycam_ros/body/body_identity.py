"""Which body it is: a hash of what its file describes."""

from dataclasses import replace
from hashlib import sha256

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.body_yaml import yaml_text

_DIGITS = 16


def body_identity(body: BodyModel) -> str:
    """Hash of a body's content, 16 hex digits; comments, layout and the report in its file do not count."""
    return sha256(yaml_text(replace(body, report={})).encode()).hexdigest()[:_DIGITS]
