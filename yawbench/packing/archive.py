"""The archive of a study: what is in it, where, and the proof that it repeats the study.

NAME/README.md          what it is and how to repeat it
NAME/repeat.sh          the one command
NAME/requirements.txt   the lock: every package with its version, and the wheel below
NAME/yawbench-*.whl     this program
NAME/scenarios/         the study and every file that it reads
NAME/fmus/              the FMUs of its runs
NAME/results/           tables, verdicts, figures, pages and runs
"""

from __future__ import annotations

import os
import shlex
import tempfile
import zipfile
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from jinja2 import Environment, PackageLoader, StrictUndefined

from yawbench.fmus.opener import HOME, further_folders
from yawbench.foundation.cache import cache_folder
from yawbench.foundation.errors import ScenarioError
from yawbench.foundation.messages import listed
from yawbench.foundation.safe_files import PACKED, read_bytes
from yawbench.orchestrator.results.record_of_plan import versions
from yawbench.orchestrator.scenario.catalogue import FOLDER, SHIPPED
from yawbench.planner import Planner
from yawbench.studies.experiment import PlannedExperiment, plan_experiment
from yawbench.studies.load_experiment import load_experiment

from .wheel import lock, wheel

FMUS, RESULTS = "fmus", "results"
TEXTS = ("README.md", "repeat.sh")
"""Files that are made from templates."""


@dataclass(frozen=True)
class Pack:
    """What an archive is made of.

    Attributes:
        planned: the study, with the plans of all runs.
        results: its results folder.
        read: files read while it was loaded and planned.
        fmus: folder of FMUs that was named, None for the default.
        quick: whether the region of open values was left out.
    """

    planned: PlannedExperiment
    results: Path
    read: Collection[Path]
    fmus: Path | None = None
    quick: bool = False

    @property
    def study(self) -> Path:
        """The study file."""
        return Path(os.path.abspath(self.planned.experiment.path))

    def by_name(self) -> dict[str, Path]:
        """Return name -> archive of the FMUs that scenarios name; others are named by their paths.

        Raises:
            ScenarioError: two FMUs have one name.
        """
        places = {HOME, cache_folder().resolve(), *(place.resolve() for place in further_folders())}
        places |= {self.fmus.resolve()} if self.fmus else set()
        named: dict[str, Path] = {}
        for fmu in self.planned.fmus.values():
            above = {*fmu.path.resolve().parents}
            if not (above & places or fmu.path.parent.name == FMUS):
                continue
            if named.setdefault(fmu.path.stem, fmu.path) != fmu.path:
                raise ScenarioError(
                    f"{fmu.path}, {named[fmu.path.stem]}: two FMUs of one name; an archive holds one",
                    code="name-duplicate",
                )
        return named

    def files(self) -> dict[PurePosixPath, Path]:
        """Return path in the archive -> file, of the study and what it reads, with their relative paths."""
        named = self.by_name().values()
        own = [self.study, *(path for path in self.read if self._goes_along(path))]
        own += [fmu.path for fmu in self.planned.fmus.values() if fmu.path not in named]
        own = sorted({Path(os.path.abspath(path)) for path in own})
        above = [folder for folder in self.study.parents if folder.name == FOLDER]
        root = Path(
            os.path.commonpath([*(path.parent for path in own), *(above[:1] or [self.study.parents[1]])])
        )
        return {PurePosixPath(FOLDER, path.relative_to(root).as_posix()): path for path in own}

    def _goes_along(self, path: Path) -> bool:
        """Return whether a file that was read is part of the study: not an FMU, a result or one of ours."""
        shipped = path.is_relative_to(SHIPPED) and not self.study.is_relative_to(SHIPPED)
        kept = (Path(os.path.abspath(self.results)), cache_folder().absolute())
        return path.suffix != ".fmu" and not shipped and not any(map(path.is_relative_to, kept))


def write_archive(pack: Pack, archive: Path) -> dict[str, int]:
    """Write the archive of a study and prove that it repeats it; return part -> its number of files.

    The proof: the unpacked files and FMUs give the same keys for all runs, which are hashes of everything
    that determines their numbers, the code of this program among it.

    Raises:
        ScenarioError: it would not repeat the study.
        OSError: it cannot be written.
    """
    name = archive.stem
    with tempfile.TemporaryDirectory(prefix="yawbench-") as folder:
        root = Path(folder, name)
        study = _lay_out(pack, root)
        _prove(pack, root, study)
        counts = {
            part.name: sum(file.is_file() for file in part.rglob("*")) for part in sorted(root.iterdir())
        }
        part = archive.with_name(f".{archive.name}.part")
        with zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as whole:
            for file in sorted(path for path in root.rglob("*") if path.is_file()):
                whole.write(file, file.relative_to(folder))
        os.replace(part, archive)
    return counts


def _lay_out(pack: Pack, root: Path) -> PurePosixPath:
    """Copy and write everything into a folder; return the path of the study in it."""
    files = pack.files()
    fmus = {PurePosixPath(FMUS, f"{name}.fmu"): path for name, path in pack.by_name().items()}
    results = {
        PurePosixPath(RESULTS, path.as_posix()): pack.results / path for path in _results(pack.results)
    }
    for target, path in {**files, **fmus, **results}.items():
        (root / target).parent.mkdir(parents=True, exist_ok=True)
        (root / target).write_bytes(read_bytes(path, largest=PACKED))
    study = next(target for target, path in files.items() if path == pack.study)
    file, content = wheel()
    (root / file).write_bytes(content)
    needed = [f"{package}=={version}" for package, version in lock().items()]
    (root / "requirements.txt").write_text("\n".join([*needed, f"./{file}", ""]), encoding="utf-8")
    for text, written in _texts(pack, study, root.name).items():
        (root / text).write_text(written, encoding="utf-8")
    (root / "repeat.sh").chmod(0o755)
    return study


def _results(folder: Path) -> Iterator[Path]:
    """Yield the files of results, relative to their folder; none that are hidden, unfinished or links."""
    for path in sorted(folder.rglob("*")):
        inside = path.relative_to(folder)
        hidden = any(part.startswith(".") for part in inside.parts)
        if path.is_file() and not (path.is_symlink() or hidden or path.suffix == ".part"):
            yield inside


def _texts(pack: Pack, study: PurePosixPath, name: str) -> Mapping[str, str]:
    spec = pack.planned.experiment.spec
    command = ["study" if spec.runs else "sweep", str(study), *(["--quick"] if pack.quick else [])]
    facts = {
        "name": name,
        "title": spec.title,
        "source": spec.source,
        "command": shlex.join([*command, "--fmus", FMUS, "--no-build", "--fresh", "--out", "repeated"]),
        "runs": len(pack.planned.jobs),
        "versions": versions(),
        "fmus": sorted((fmu.name, digest, _source_in(fmu.path)) for digest, fmu in pack.planned.fmus.items()),
    }
    loader = PackageLoader("yawbench.packing")
    environment = Environment(
        loader=loader, undefined=StrictUndefined, keep_trailing_newline=True, trim_blocks=True
    )
    return {text: environment.get_template(f"{text}.j2").render(facts) for text in TEXTS}


def _source_in(archive: Path) -> str:
    """Return in which folder an FMU has its source, "none" if it has none."""
    with zipfile.ZipFile(archive) as members:
        names = members.namelist()
    if any(name.startswith("resources/") and name.endswith(".py") for name in names):
        return "`resources/` (Python)"
    return "`sources/` (C)" if any(name.startswith("sources/") for name in names) else "none"


def _prove(pack: Pack, root: Path, study: PurePosixPath) -> None:
    """Check that the files of an unpacked archive plan the same runs.

    Raises:
        ScenarioError: they do not.
    """
    here = Path.cwd()
    os.chdir(root)  # names of scenarios are looked for from the working folder
    try:
        experiment = load_experiment(Path(study))
        if pack.quick and experiment.spec.repeats:
            experiment = experiment.short
        again = plan_experiment(experiment, Path("repeated"), planner=Planner(build=False), fmus=Path(FMUS))
    except ScenarioError as error:
        sentences = [diagnostic.message for diagnostic in error.diagnostics]
        raise ScenarioError(
            [f"the archive does not repeat the study: {text}" for text in sentences], code=error.code
        ) from None
    finally:
        os.chdir(here)
    pairs = zip(pack.planned.jobs, pack.planned.keys, again.keys, strict=True)
    if other := [job.label for job, key, theirs in pairs if key != theirs]:
        raise ScenarioError(
            f"the archive does not repeat the study: other files or FMUs are found for {listed(other)}",
            code="file-wrong-kind",
        )
