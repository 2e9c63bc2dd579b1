"""`yawbench pack`: a study as an archive that others repeat with one command."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from yawbench.commands import json_and_latex
from yawbench.commands.experiments import StudyFile, chapter_of, command_of, conduct, write_page
from yawbench.commands.options import RunOptions, pooled, takes
from yawbench.commands.terminal_progress import hold, say
from yawbench.foundation.errors import ScenarioError
from yawbench.foundation.messages import counted, in_bytes

Archive = Annotated[
    Path | None,
    typer.Option(
        "--out",
        metavar="FILE",
        help="Archive to write. Default: <folder>_<name>.zip in the working directory.",
    ),
]


@takes("fmus", "no_build", "jobs", "quick")
def pack(context: typer.Context, file: StudyFile, options: RunOptions, out: Archive = None) -> None:
    """Write a study as an archive that others repeat with one command.

    It holds the study and all files that it reads, its FMUs, its results (those of `yawbench study` without
    --out; missing runs are made first), this program as a wheel, the versions of all packages, and a README.
    `sh repeat.sh` in it repeats the study and compares tables and runs byte by byte. The archive is tried
    before it is written: its files must give the same keys for all runs.
    """
    from yawbench.foundation.safe_files import noting_files
    from yawbench.orchestrator.results.folder_names import default_folder, names_of
    from yawbench.studies.load_experiment import load_experiment

    from .archive import Pack, write_archive

    archive = out or Path(f"{'_'.join(filter(None, names_of(file)))}.zip")
    if archive.suffix != ".zip":
        raise ScenarioError(f"--out {archive}: an archive ends with .zip", code="option-invalid")
    folder = default_folder(file)
    with noting_files() as read:
        experiment = load_experiment(file)
        hold(context, folder)
        each = pooled(context, options)
        findings = conduct(experiment, folder, options, each)
        kind = "study" if experiment.spec.runs else "sweep"
        command = command_of(kind, experiment.path, quick=options.quick)
        write_page(chapter_of(findings, folder, command, each=each), folder)
    planned = findings.planned
    assert planned is not None
    say(f"packing {archive}")
    counts = write_archive(Pack(planned, folder, read, options.fmus, options.quick), archive)
    say(
        f"{archive}: {counted(counts['scenarios'], 'file')}, {counted(counts.get('fmus', 0), 'FMU')}, "
        f"{counted(counts['results'], 'file')} of results, {in_bytes(archive.stat().st_size)}"
    )
    json_and_latex.answer(archive=archive, files=counts)
