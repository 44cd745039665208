"""Damage to a URDF: entities, bombs, and robots that are none."""

import re
from collections.abc import Mapping

import numpy as np
from faults.yaml_damage import ESCAPE, Damage, replaced

_NUMBER = re.compile(r"(?<=[\" ])-?\d+\.\d+(?=[\" ])")
_NAME = re.compile(r"(?<=name=\")[^\"]+(?=\")")
_PARENT = re.compile(r"(?<=<parent link=\")[^\"]+(?=\")")


def _with_entities(entities: str, reference: str) -> Damage:
    def damage(text: str, random: np.random.Generator) -> str:
        declared = f'<?xml version="1.0"?>\n<!DOCTYPE robot [{entities}]>\n'
        return declared + replaced(_NAME, reference)(re.sub(r"<\?xml.*?\?>", "", text), random)

    return damage


def _lol(levels: int = 9) -> str:
    lines = ['<!ENTITY l0 "lollollollol">']
    lines += [f'<!ENTITY l{n} "{f"&l{n - 1};" * 10}">' for n in range(1, levels + 1)]
    return "".join(lines)


def _quadratic() -> str:
    return f'<!ENTITY a "{"x" * 100_000}">'


def _inserted(content: str) -> Damage:
    return lambda text, random: text.replace("</robot>", f"{content}</robot>")


def _chain(length: int) -> str:
    links = "".join(f'<link name="c{n}"/>' for n in range(length))
    joints = "".join(
        f'<joint name="j{n}" type="fixed"><parent link="c{n - 1}"/><child link="c{n}"/></joint>'
        for n in range(1, length)
    )
    return links + joints


DAMAGES: Mapping[str, Damage] = {
    "entity bomb": _with_entities(_lol(), "&l9;"),
    "quadratic entities": _with_entities(_quadratic(), "&a;" * 2000),
    "file as entity": _with_entities('<!ENTITY f SYSTEM "file:///etc/hostname">', "&f;"),
    "unknown entity": lambda text, random: replaced(_NAME, "&nobody;")(text, random),
    "deep elements": _inserted("<a>" * 100_000 + "</a>" * 100_000),
    "deep and open": _inserted("<a>" * 3000),
    "a chain of a thousand": _inserted(_chain(1000)),
    "twenty thousand links": _inserted("".join(f'<link name="l{n}"/>' for n in range(20_000))),
    "nan": replaced(_NUMBER, "nan"),
    "inf": replaced(_NUMBER, "inf"),
    "number beyond float": replaced(_NUMBER, "1e999"),
    "number of 5000 digits": replaced(_NUMBER, "9" * 5000),
    "text for a number": replaced(_NUMBER, "many"),
    "empty name": replaced(_NAME, ""),
    "long name": replaced(_NAME, "x" * 100_000),
    "escape as name": replaced(_NAME, "&#155;31m"),
    "raw escape as name": replaced(_NAME, ESCAPE),
    "own parent": replaced(_PARENT, "nobody"),
    "in a circle": lambda text, random: re.sub(r'<parent link="pelvis"/>', '<parent link="shin_left"/>', text),
    "another root element": lambda text, random: text.replace("<robot", "<sdf").replace("</robot", "</sdf"),
    "two robots": lambda text, random: text + text,
    "wrong encoding": lambda text, random: '<?xml version="1.0" encoding="utf-16"?>' + text,
    "unknown encoding": lambda text, random: '<?xml version="1.0" encoding="klingon"?>' + text,
    "names twice": lambda text, random: re.sub(_NAME, "same", text),
    "no joints": lambda text, random: re.sub(r"(?s)<joint.*</joint>", "", text),
    "unclosed": lambda text, random: text.replace("</robot>", ""),
}
