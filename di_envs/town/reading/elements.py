"""XML elements that know their line, and their attributes as numbers within reason.

Who reads a map that does not open needs the place in the file, so every refusal names a line.
"""

from __future__ import annotations

import codecs
import math
import re
from collections.abc import Iterable
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

import numpy as np

from di_envs.town.reading.records import Float64

LONGEST_M = 1e5  # of a road, and the last station that anything on it may have
_LARGEST = 1e12  # of a coefficient; what larger ones make is no road
_FASTEST = 1000.0  # of a speed limit, in its unit
_SPEED_UNITS_MPS = {None: 1.0, "m/s": 1.0, "mph": 0.44704, "km/h": 1.0 / 3.6}
_LAST_LANE = 200  # greatest lane id to either side
_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
    (b"<\0", "utf-16-le"),
    (b"\0<", "utf-16-be"),
)
_DECLARED = re.compile(rb"^\s*<\?xml[^>]*?encoding\s*=\s*[\"']([A-Za-z0-9._-]+)[\"']")


class _LinedElement(Element):
    line = 0


def decode_xml(content: bytes, source: str) -> str:
    """The text of an XML file: by its byte order mark, its first bytes, its declaration, or UTF-8.

    Raises:
        ValueError: If it is not text in that encoding.
    """
    declared = _DECLARED.match(content)
    encoding = next((name for mark, name in _MARKS if content.startswith(mark)), None)
    if encoding is None:
        encoding = declared[1].decode("ascii") if declared else "utf-8"
        if encoding.lower().startswith(("utf-16", "utf16", "utf-32", "utf32")):
            encoding = "utf-8"  # its declaration could be read byte by byte
    try:
        return content.decode(encoding)
    except (LookupError, UnicodeError) as error:
        raise ValueError(
            f"{source} is not text in the encoding '{encoding}' that it says or begins as "
            f"({error}); expected an OpenDRIVE file (.xodr)."
        ) from error


def parse_xml(text: str, source: str) -> Element:
    """The root of XML; its elements know their line, and no namespaces.

    Raises:
        ValueError: If it is not well-formed.
    """
    builder = TreeBuilder(element_factory=_LinedElement)
    parser = expat.ParserCreate(namespace_separator="}")
    parser.buffer_text = True

    def start(tag: str, attributes: dict[str, str]) -> None:
        element = builder.start(tag.rpartition("}")[2], attributes)
        assert isinstance(element, _LinedElement)
        element.line = parser.CurrentLineNumber

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda tag: builder.end(tag.rpartition("}")[2])
    parser.CharacterDataHandler = builder.data
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        raise ValueError(
            f"{source} is not well-formed XML ({error}); expected an OpenDRIVE file (.xodr)."
        ) from error
    return builder.close()


def line_of(element: Element) -> int:
    """The line of the file in which an element begins."""
    return element.line if isinstance(element, _LinedElement) else 0


def refused(element: Element, why: str) -> ValueError:
    """An error that says in which line something is wrong."""
    return ValueError(f"line {line_of(element)}: {why}")


def named(element: Element) -> str:
    """An element's id.

    Raises:
        ValueError: If it has none.
    """
    name = element.get("id")
    if not name:
        raise refused(element, f"<{element.tag}> has no attribute 'id'")
    return name


def unique(elements: Iterable[Element]) -> dict[str, Element]:
    """Elements by id.

    Raises:
        ValueError: If two have the same one.
    """
    found: dict[str, Element] = {}
    for element in elements:
        name = named(element)
        if name in found:
            raise refused(
                element,
                f"the id of <{element.tag} id='{name}'> is taken by that of line "
                f"{line_of(found[name])}; give one of them another",
            )
        found[name] = element
    return found


def number(
    element: Element,
    key: str,
    default: float | None = None,
    *,
    least: float = -_LARGEST,
    most: float = _LARGEST,
) -> float:
    """An attribute as a finite number.

    Raises:
        ValueError: If it is missing and has no default, is no number, or lies outside of its range.
    """
    text = element.get(key)
    if text is None:
        if default is None:
            raise refused(element, f"<{element.tag}> has no attribute '{key}'")
        return default
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if math.isnan(value):
        raise refused(element, f"<{element.tag} {key}='{text}'> is not a number")
    if not least <= value <= most:
        raise refused(
            element,
            f"<{element.tag} {key}='{text}'> is out of all proportion; "
            f"expected {least:g} to {most:g}",
        )
    return value


def station(element: Element, key: str, default: float | None = None) -> float:
    """An attribute as a station along a road [m]."""
    return number(element, key, default, least=-1.0, most=LONGEST_M)


def lane_number(element: Element, key: str, default: int | None = None) -> int:
    """An attribute as a lane id.

    Raises:
        ValueError: If it is missing and has no default, is no integer, or is out of proportion.
    """
    value = number(element, key, default, least=-_LAST_LANE, most=_LAST_LANE)
    if value != round(value):
        raise refused(element, f"<{element.tag} {key}='{element.get(key)}'> is not an integer")
    return int(value)


def cubics(elements: Iterable[Element], key: str = "s", base: float = 0.0) -> Float64:
    """(N, 5) begin [m] and a, b, c, d of each element's cubic, by where it begins; one of zeros."""
    rows = [
        [base + station(e, key, 0.0), *(number(e, c, 0.0) for c in ("a", "b", "c", "d"))]
        for e in elements
    ]
    table = np.array(rows or [[base, 0.0, 0.0, 0.0, 0.0]])
    return table[np.argsort(table[:, 0], kind="stable")]


def speed_limit(element: Element | None) -> float | None:
    """A limit [m/s]; None where there is none, which some files write as 0."""
    if element is None or element.get("max") in (None, "no limit", "undefined"):
        return None
    unit = element.get("unit")
    if unit not in _SPEED_UNITS_MPS:
        known = ", ".join(u for u in _SPEED_UNITS_MPS if u)
        raise refused(element, f"speed unit '{unit}' is unknown; known: {known}")
    return number(element, "max", least=0.0, most=_FASTEST) * _SPEED_UNITS_MPS[unit] or None
