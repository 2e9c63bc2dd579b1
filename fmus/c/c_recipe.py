"""Recipe of components written in C: an FMU from a folder with modelDescription.xml and C files.

Variables are declared only in the model description; `variables.h` is generated from it at every build, and
the GUID is derived from it and the sources. As with Python components, the same sources and the same compiler
give the same bytes.
"""

from __future__ import annotations

import hashlib
import sys
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from yawbench.foundation.errors import BuildError
from yawbench.vocabulary.roles import ROLES

from ..build_stamp import PLAIN, Edition
from ..compiler import compile_library, compiler_command, compiler_version, libraries_for
from ..description import platform
from ..native.build import HEADERS as COMMON
from ..packing import DESCRIPTION, set_guid
from ..presentation import PAGE, icon
from ..recipe import Made, wanted_platforms
from ..source_archive import source_files
from ..source_digests import SourceDigests
from .declaration import headers, read_declaration

HERE = Path(__file__).resolve().parent
HEADERS = (HERE / "unit.h", *COMMON.values())
SHARED = (
    Path(__file__),
    HERE / "declaration.py",
    *HEADERS,
    HERE.parent / "compiler.py",
    HERE.parent / "packing.py",
    HERE.parent / "presentation.py",
    PAGE,
)
"""Files on which every FMU in C depends."""
EXACT = ("-std=c11", "-ffp-contract=off")  # no fused multiply-add: same results everywhere
FLAGS = (*EXACT, "-O2", "-Wall", "-Wextra", "-Wno-unused-parameter", "-shared", "-fvisibility=hidden")
LINUX = ("-fPIC", "-Wl,--build-id=none", "-Wl,-z,defs", "-s")


def find_c_components(root: Path) -> dict[str, Path]:
    """Return name of FMU -> folder of every component in C below `root`."""
    components = {}
    for role in ROLES:
        for file in sorted((root / role).glob(f"*/{DESCRIPTION}")):
            components[f"{ROLES[role].name}_{file.parent.name}"] = file.parent
    return components


@dataclass(frozen=True)
class CRecipe:
    """Component in C; its parent folder gives the role, as in `controllers/idea/idea.c`.

    Raises:
        BuildError: no model description, or no role.
    """

    source: Path

    def __post_init__(self) -> None:
        if not (self.source / DESCRIPTION).is_file():
            raise BuildError(f"{self.source}: not a component in C: it contains no {DESCRIPTION}")
        if self.source.parent.name not in ROLES:
            folders = ", ".join(ROLES)
            raise BuildError(
                f"{self.source}: which role? Put it into a folder called one of: {folders}",
                code="component-without-role",
            )

    @property
    def name(self) -> str:
        return f"{self.role}_{self.source.name}"

    @property
    def role(self) -> str:
        return ROLES[self.source.parent.name].name

    def listing(self) -> dict[str, str]:
        return {file.name: file.read_text("utf-8", "replace") for file in self._files()[1:]}

    def key(self) -> str:
        content = hashlib.sha256("\0".join([self.name, *LINUX, *FLAGS]).encode())
        for file in [*SHARED, *icon(self.role), *self._files()]:
            data = file.read_bytes()
            content.update(f"{file.name}\0{len(data)}\0".encode() + data)
        return content.hexdigest()[:32]

    def evidence(self) -> dict[str, str]:
        return SourceDigests().evidence([self.source, self._twin, *SHARED, *icon(self.role), *self._files()])

    @property
    def _twin(self) -> Path:
        return self.source.with_suffix(".py")

    def _files(self) -> list[Path]:
        return [self.source / DESCRIPTION, *sorted(self.source.glob("*.[ch]"))]

    def make(self, *, hurry: bool = False, edition: Edition = PLAIN) -> Made:
        """Return the files of the archive (see `PythonRecipe.make`)."""
        if self._twin.exists():
            folder = self.source
            raise BuildError(f"there are both {folder.name}.py and {folder.name}/ in {folder.parent}")
        compiler_version(compiler_command())  # raises if there is none
        description, *code = self._files()
        sources = {file.name: file.read_bytes() for file in code}
        c_files = [name for name in sources if name.endswith(".c")]
        if not c_files:
            raise BuildError(f"{self.source} contains no C file")
        role = ROLES[self.source.parent.name]
        root, variables = read_declaration(description.read_bytes(), self.name, role)
        made = headers(variables, set_guid(root, sources))
        sources |= {name: text.encode() for name, text in made.items()}
        sources |= {header.name: header.read_bytes() for header in HEADERS}
        arguments = [*FLAGS, *c_files, "-lm"]
        system, suffix = platform()
        own = LINUX if sys.platform == "linux" else ()
        library = compile_library(compiler_command(), sources, *own, *arguments)
        files = {
            DESCRIPTION: ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n",
            f"binaries/{system}/{self.name}{suffix}": library,
        }
        if not hurry and sys.platform == "linux":
            files |= libraries_for(wanted_platforms(edition), self.name, sources, *arguments)
        if edition.sources:
            files |= source_files(sources, c_files, self.name, EXACT)
        return Made(files, later=hurry and bool(edition.platforms))
