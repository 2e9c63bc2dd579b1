"""Sources in C within an FMU, from which a host compiles its library: files, and how to compile them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

FOLDER = "sources"
EXACTLY = b"""/* As the options of the build description, which not every host passes to the compiler. */
#if defined __clang__
#pragma STDC FP_CONTRACT OFF
#elif defined __GNUC__
#pragma GCC optimize("fp-contract=off", "rounding-math")
#endif
#define YAWBENCH_OLDEST_GLIBC_H /* compiled where it runs, for this glibc */
"""
DESCRIPTION = f"{FOLDER}/buildDescription.xml"


def source_files(
    sources: Mapping[str, bytes], compiled: Sequence[str], name: str, options: Sequence[str]
) -> dict[str, bytes]:
    """Return sources as path in the archive -> content, with their build description of FMI 3.0.

    Args:
        sources: name -> content.
        compiled: names of the files to compile.
        name: model identifier.
        options: of GCC and Clang, without which results may differ in the last bit.
    """
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = SubElement(root, "BuildConfiguration", modelIdentifier=name)
    files = SubElement(
        configuration, "SourceFileSet", language="C11", compiler="gcc", compilerOptions=" ".join(options)
    )
    for file in compiled:
        SubElement(files, "SourceFile", name=file)
    SubElement(configuration, "Library", name="m")
    ElementTree.indent(root)
    description = ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"
    return {
        DESCRIPTION: description,
        **{f"{FOLDER}/{file}": EXACTLY * (file in compiled) + text for file, text in sources.items()},
    }


def list_sources(description: Element, files: Mapping[str, bytes]) -> None:
    """Name the files to compile in a model description of FMI 2.0, which has its own place for them."""
    if DESCRIPTION not in files:
        return
    known = ElementTree.fromstring(files[DESCRIPTION]).iterfind("BuildConfiguration/SourceFileSet/SourceFile")
    kind = description.find("CoSimulation")
    if kind is not None and kind.find("SourceFiles") is None:
        group = Element("SourceFiles")
        kind.insert(0, group)
        for file in known:
            SubElement(group, "File", name=file.get("name", ""))
