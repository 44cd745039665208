"""The XML of a URDF, which may come from anywhere.

There are no entities, which could stand for any file or any length, and what is read is bounded. A launch file reads
it too: nothing but the standard library is imported.
"""

import xml.etree.ElementTree as ET
from xml.parsers import expat

from bodycam_ros.errors import BodyError

MOST_LETTERS = 4_000_000
"""Of a document; that of a person with 16 cameras has 20,000."""

_MOST_LEVELS = 50


def xml_elements(text: str) -> ET.Element:
    """The elements of a document.

    Raises:
        BodyError: it is not XML, too long, nested too deeply, or has a document type.
    """
    if len(text) > MOST_LETTERS:
        raise BodyError(f"a URDF of {len(text)} letters is not read; a body's has fewer than {MOST_LETTERS}")
    parser, builder = expat.ParserCreate(), ET.TreeBuilder()
    open_tags: list[str] = []

    def start(tag: str, attributes: dict[str, str]) -> None:
        open_tags.append(tag)
        if len(open_tags) > _MOST_LEVELS:
            raise BodyError(f"elements are nested deeper than {_MOST_LEVELS} levels, which no URDF needs")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        open_tags.pop()
        builder.end(tag)

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = _refuse_doctype
    try:
        parser.Parse(text, True)
        return builder.close()
    except (expat.ExpatError, ValueError) as error:
        raise BodyError(f"this is not XML: {error}") from error


def _refuse_doctype(*_: object) -> None:
    raise BodyError("a URDF has no <!DOCTYPE>, and so no entities; remove it")
