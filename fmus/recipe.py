"""Recipe of Python components, which makes the files of an FMU (for components in C: `c.c_recipe`)."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any

from yawbench.foundation.errors import BuildError
from yawbench.vocabulary.roles import ROLES

from .archive import REASON, UNTRIED
from .build_stamp import PLAIN, Edition
from .compiler import MINGW, OWN, PLATFORMS, TO_WINDOWS, Platform, compile_launcher, launcher_sources
from .native.build import HEADERS, native, toolchain
from .packing import LIBRARIES, pack
from .presentation import PAGE, icon
from .source_digests import SourceDigests
from .source_files import Parts, Sources
from .staging import entry_module, missing_signals, staged, variant

TOOL = f"yawbench {version('yawbench')}, pythonfmu {version('pythonfmu')}"
HERE = Path(__file__).resolve().parent


@dataclass(frozen=True)
class Made:
    """Files of an archive, as a recipe makes them.

    Attributes:
        files: path in the archive -> content.
        modules: names of the Python modules among them.
        later: whether another build may add native libraries.
    """

    files: dict[str, bytes]
    modules: tuple[str, ...] = ()
    later: bool = False


def wanted_platforms(edition: Edition) -> list[Platform]:
    """Return the platforms other than this for which native libraries are compiled.

    Windows is among them where MinGW is installed, which takes a second; Zig takes many, for each platform.
    """
    names = {*edition.platforms} | ({TO_WINDOWS.name} if shutil.which(MINGW) else set())
    return [PLATFORMS[name] for name in PLATFORMS if name in names and PLATFORMS[name] != OWN]


@dataclass(frozen=True)
class PythonRecipe:
    """Recipe of the FMU of a Python component. Methods raise BuildError if the sources are wrong."""

    name: str
    module: Parts
    sources: Sources
    defaults: Mapping[str, Any] = field(default_factory=dict)

    @property
    def source(self) -> Path:
        return self.sources.file(self.module)

    @property
    def role(self) -> str:
        return ROLES[self.module[0]].name

    def listing(self) -> dict[str, str]:
        """Component's own file, as path -> text."""
        path = "/".join(self.module) + ".py"
        return {path: self._files[path]}

    @cached_property
    def _files(self) -> dict[str, str]:
        return self.sources.closure(self.module)

    def key(self) -> str:
        """Return a hash of everything that determines the content of the FMU."""
        parts = [self.name, ".".join(self.module), json.dumps(dict(self.defaults)), _builder(self.role)]
        parts += [toolchain(), hashlib.sha256(launcher_sources()).hexdigest(), _hash(self._files)]
        return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:32]

    def evidence(self) -> dict[str, str]:
        """Return the evidence for the key (see `evidence`)."""
        self._files  # noqa: B018 - parses the sources, which gives their evidence
        libraries = [f"tool:{file}" for file in LIBRARIES]
        translator = [*sorted((HERE / "native").glob("*.py")), *HEADERS.values()]
        return self.sources.evidence[self.module] | SourceDigests().evidence(
            [
                *sorted(HERE.glob("*.[pch]*")),
                *icon(self.role),
                *translator,
                *libraries,
            ]
        )

    def make(self, *, hurry: bool = False, edition: Edition = PLAIN) -> Made:
        """Return the files of the archive, of FMI 2.0 whatever the edition.

        With `hurry`, a native library that takes long to build is postponed, and so are other platforms.
        """
        module, files = self.module, self._files
        if self.defaults or self.name != natural_name(module):
            with staged(files, "yawbench_variant") as stage:
                text = variant(stage.component(module), self.name, self.defaults)
            module = (*module[:-1], f"{module[-1]}_variant")
            files = files | {"/".join(module) + ".py": text}
        digest = _hash(files)[:12]
        package, entry = f"yawbench_{digest}", f"{self.name}_{digest}"
        with staged(files, package) as stage:
            component = stage.component(module)
            problems = missing_signals(ROLES[module[0]], component.variables)
            if problems:
                raise BuildError(problems)
            description = stage.description(component)
            resources = {f"{package}/{path}": text for path, text in files.items()}
            resources[f"{entry}.py"] = entry_module(self.name, component)
            resources["slavemodule.txt"] = entry
            launcher, _ = compile_launcher()
            packed = pack(resources, description, name=self.name, version=digest, launcher=launcher)
            library = native(
                component,
                stage.folder / package,
                source="/".join(module) + ".py",
                guid=description.get("guid", ""),
                resources=stage.folder,
                read=stage.read,
                hurry=hurry,
                others_too=() if hurry else wanted_platforms(edition),
                with_sources=edition.sources,
            )
        packed |= library.files
        packed[REASON] = library.why_not.encode()
        if library.untried:
            packed[UNTRIED] = "".join(f"{place}\n" for place in library.untried).encode()
        later = library.later or (hurry and bool(edition.platforms))
        return Made(packed, (package, entry), later=later or launcher is None)


def natural_name(module: Parts) -> str:
    """Return the default name of the FMU of a module: `<role>_<file>`."""
    return f"{ROLES[module[0]].name}_{module[-1]}"


@cache
def _builder(role: str) -> str:
    """Return a hash of this builder, PythonFMU's libraries and the icon of a role."""
    content = hashlib.sha256(TOOL.encode())
    for file in [*sorted(HERE.glob("*.py")), PAGE, *LIBRARIES, *icon(role)]:
        content.update(file.read_bytes())
    return content.hexdigest()


def _hash(files: Mapping[str, str]) -> str:
    content = hashlib.sha256()
    for path, text in sorted(files.items()):
        content.update(f"{path}\0{len(text)}\0{text}".encode())
    return content.hexdigest()
