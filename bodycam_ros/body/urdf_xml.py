"""XML from any source. A launch file reads it too: nothing but the standard library is imported."""

import xml.etree.ElementTree as ET

from bodycam_ros.errors import BodyError

MAX_LETTERS = 4_000_000
"""Longest text of a document; that of a person with 16 cameras has 20,000."""


def xml_elements(text: str) -> ET.Element:
    """The elements of a document.

    Raises:
        BodyError: it is not XML, too long, or has a document type, whose entities could stand for any file or length.
    """
    if len(text) > MAX_LETTERS:
        raise BodyError(f"XML of {len(text)} letters is not read; the URDF of a body has fewer than {MAX_LETTERS}")
    if "<!DOCTYPE" in text:
        raise BodyError("it has a <!DOCTYPE>, and so may have entities; remove that")
    try:
        return ET.fromstring(text)
    except (ET.ParseError, ValueError) as error:
        raise BodyError(f"this is not XML: {error}") from error
