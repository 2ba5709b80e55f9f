"""XML from anywhere: without entities, of bounded size and depth."""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from peaking.datasets.foreign_files import read_bytes
from peaking.errors import RecordingError
from peaking.limits import MAX_XML_BYTES, MAX_XML_DEPTH

_AGAIN = "export it again"


class _Refused(Exception):
    """What is not read."""


def xml_of(path: Path, *, within: Path | None = None) -> Element:
    """Return the root of an XML file; names are without their namespaces.

    Args:
        path: The file.
        within: A folder; links that lead out of it are refused.

    Raises:
        RecordingError: It cannot be read, is no XML, is nested deep, or declares a document type:
            a few entities may stand for gigabytes.
    """
    data = read_bytes(path, within=within, at_most=MAX_XML_BYTES)
    builder, depth = TreeBuilder(), 0
    parser = expat.ParserCreate(namespace_separator="}")

    def start(name: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > MAX_XML_DEPTH:
            raise _Refused(f"is nested more than {MAX_XML_DEPTH} deep")
        builder.start(_local(name), {_local(key): text for key, text in attributes.items()})

    def end(name: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(_local(name))

    def refuse(*_: object) -> None:
        raise _Refused("declares a document type, which is not read")

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(data, True)
        return builder.close()
    except _Refused as error:
        raise RecordingError(path, str(error), remedy=_AGAIN) from error
    except (expat.ExpatError, ValueError, LookupError) as error:
        raise RecordingError(path, f"is not XML ({error})", remedy=_AGAIN) from error


def _local(name: str) -> str:
    return name.rpartition("}")[2]
