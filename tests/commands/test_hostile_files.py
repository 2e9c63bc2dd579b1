"""Users' files that are wrong in unusual or misleading ways: each is answered by a sentence."""

from __future__ import annotations

import os
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest

from tests.cars import load_scenario, make_plan
from tests.command_line import status_of
from tests.fmus.fake_fmus import Var, make_fmu, out
from tests.refusals import each_mentions, mentions, refused, texts_of, told
from tests.reports.made_up import unpacked
from yawbench.commands.check import show
from yawbench.commands.output import print_tables
from yawbench.commands.terminal_progress import say
from yawbench.fmus import zip_members
from yawbench.foundation.errors import Diagnostic, ScenarioError, YawbenchError
from yawbench.foundation.safe_files import reading
from yawbench.orchestrator.scenario import yaml_lines
from yawbench.orchestrator.scenario.overrides import read_changes
from yawbench.reports.page_parts import render
from yawbench.reports.study_page import chapter
from yawbench.studies.experiment import LoadedExperiment
from yawbench.studies.experiment_result import judge_results
from yawbench.studies.expression import Expression
from yawbench.studies.load_experiment import load_experiment
from yawbench.studies.schema import ExperimentSpec
from yawbench.studies.tables import Table

HEAD = "stop_time: 1\nstep_size: 0.01\n"
STUDY = "title: t\nmetrics: {m: {metric: peak(sideslip)}}\nruns:\n"
SWEEP = "title: t\nscenario: a.yaml\nmetrics: {m: {metric: peak(sideslip)}}\n"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cache: Path) -> Path:
    """The working directory, with one FMU."""
    monkeypatch.chdir(tmp_path)
    make_fmu(tmp_path / "fmus" / "plant.fmu", outputs=["speed"], parameters=[Var("mass", "kg")])
    return tmp_path


def problems(text: str | bytes, **options: list[str]) -> list[Diagnostic]:
    """Return the diagnostics of a scenario file with this text."""
    Path("a.yaml").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(YawbenchError) as caught:
        make_plan(load_scenario(Path("a.yaml"), changes=read_changes(**options)))
    assert caught.value.__cause__ is None, "caught by the net for what is not foreseen"
    assert all(len(problem) < 12_000 for problem in texts_of(caught.value))
    return caught.value.diagnostics


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        (
            "units: !own {a: {fmu: plant}}",
            "value-invalid | a.yaml:3: units | '!own'\nvalue-wrong-type | a.yaml:3: units",
        ),
        (
            "title: !!binary aGk=",
            "key-missing | a.yaml:1\n"
            "value-invalid | a.yaml:3: title | 'tag:yaml.org,2002:binary'\n"
            "value-wrong-type | a.yaml:3: title",
        ),
        ('title: "\\U00FFFFFF"', "file-not-yaml | a.yaml:3 | 0x110000"),
        ("title: !<%ff> b", "file-not-yaml | a.yaml:3 | 0xff"),
        ("title: !%zz b", "file-not-yaml | a.yaml:3 | 'z'"),
        ('title: "a \\u202e b"', "key-missing | a.yaml:1\nvalue-invalid | a.yaml:3: title | \\u202e"),
        ('title: "\\ud800"', "key-missing | a.yaml:1\nvalue-invalid | a.yaml:3: title | \\ud800"),
        (
            '"\\e[2J": 1',
            "key-missing | a.yaml:1\n"
            "value-invalid | a.yaml:3: \x1b[2J | \\x1b\n"
            "key-unknown | a.yaml:3: \x1b[2J",
        ),
        ("title: " + "[" * 45 + "]" * 45, "file-not-yaml | a.yaml:3 | 40 brackets"),
        (
            "title:\n" + "".join(f"{' ' * n}-\n" for n in range(1, 50)),
            "file-too-large | a.yaml:3: title | 40 collections",
        ),
        (
            "inputs: {a: " + "1" * 400 + "}",
            "key-missing | a.yaml:1\n"
            f"value-invalid | a.yaml:3: inputs.a | {'1' * 56}\n"
            "value-invalid | a.yaml:3: inputs.a",
        ),
        (
            "inputs: {a: " + "1" * 5000 + "}",
            "key-missing | a.yaml:1\n"
            f"value-wrong-type | a.yaml:3: inputs.a | {'1' * 56}\n"
            "value-invalid | a.yaml:3: inputs.a",
        ),
    ],
)
def test_yaml_beyond_what_scenarios_use_is_refused_in_a_sentence(text: str, lines: str) -> None:
    assert told(problems(f"{HEAD}{text}\n"), lines)


@pytest.mark.parametrize(
    ("value", "code", "names"),
    [
        ("1" * 400, "value-invalid", ("1" * 56, "kg")),
        ("[" * 3000, "value-invalid", ("[" * 56, "kg")),
        ("5 " + "(" * 3000, "value-invalid", ("5 " + "(" * 54, "kg")),
        ("5 " + "(" * 50 + "kg" + ")" * 40, "unit-unknown", ("(" * 50 + "kg", "'kg'")),
        ("1e999 kg", "value-invalid", ("'1e999 kg'", "finite")),
        ("1e999", "value-invalid", ("inf", "finite")),
        ("nan", "value-invalid", ("'nan'", "kg")),
        (".nan", "value-invalid", ("nan", "finite")),
    ],
)
def test_a_setting_that_is_no_quantity_is_refused_in_a_sentence(
    value: str, code: str, names: tuple[str, ...]
) -> None:
    (found,) = problems(f"{HEAD}units: {{a: {{fmu: plant}}}}\n", settings=[f"a.mass={value}"])
    assert str(found).startswith("--set a.mass=")
    assert found.code == code
    assert len(str(found)) < 3200 and len(found.message) < 200
    assert mentions(found.message, *names)


@pytest.mark.parametrize("name", ["n" * 4000, "n" * 300 + ".yaml", "a\0b"])
def test_names_that_cannot_be_those_of_files_are_refused(name: str) -> None:
    assert problems(f"{HEAD}units: {{a: {{fmu: {name!r}}}}}\n".replace("\0", "\\0").replace("'", '"'))
    assert problems(f'{HEAD}vehicle: "{name}"\nunits: {{a: {{fmu: plant}}}}\n'.replace("\0", "\\0"))
    assert problems(f"{HEAD}units: {{a: {{fmu: plant}}}}\n", swaps=[f"a={name}"])
    with pytest.raises(ScenarioError):
        load_scenario(Path(name))


def test_a_name_with_a_line_feed_can_be_swapped_in_and_is_not_found() -> None:
    (said,) = problems(f"{HEAD}units: {{a: {{fmu: plant}}}}\n", swaps=["a=pl\nant"])
    assert mentions(said, "'pl\\nant'")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names here")
def test_pipes_devices_and_loops_of_links_are_not_read() -> None:
    os.mkfifo("pipe.yaml")
    os.symlink("loop.yaml", "loop.yaml")
    for path in ("pipe.yaml", "/dev/zero", "loop.yaml"):
        with refused(ScenarioError, "file-unreadable", names=(path,)):
            load_scenario(Path(path))


@pytest.mark.skipif(not os.path.exists("/dev/zero"), reason="no such device here")
def test_a_device_in_place_of_an_fmu_or_a_vehicle_file_is_not_read() -> None:
    (said,) = problems(f"{HEAD}units: {{a: {{fmu: /dev/zero}}}}\n")
    assert mentions(said, "a.yaml:3", "units.a.fmu")
    (said,) = problems(f"{HEAD}vehicle: /dev/zero\nunits: {{a: {{fmu: plant}}}}\n")
    assert mentions(said, "vehicle", "file", "socket")


def test_a_file_that_is_too_large_is_not_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(yaml_lines, "TEXT", 1000)
    (said,) = problems("a" * 1001)
    assert mentions(said, "a.yaml", "1 kB")


def test_of_very_many_problems_the_first_ones_are_told() -> None:
    units = "".join(f"  u{i}: {{fmi: plant}}\n" for i in range(1000))
    said = problems(f"{HEAD}units:\n{units}")
    assert len(said) == yaml_lines.MOST_ERRORS + 1
    assert mentions(said[-1], "a.yaml", "200 problems")


@pytest.mark.parametrize(
    ("step", "line"),
    [
        (  # "nearest allowed: 10 s", which it was
            "0.0333333333333",
            "time-grid-invalid | a.yaml:1: stop_time | 10 s | 0.0333333333333 s | 9.99999999999 s"
            " | 10.0333333333233 s | 1/30 s | step_size",
        ),
        (
            "0.0333",
            "time-grid-invalid | a.yaml:1: stop_time | 10 s | 9.99 s | 10.0233 s | step_size | 1/30 s",
        ),
        ("1/0 s", "value-invalid | a.yaml:2: step_size | '1/0 s'"),
    ],
)
def test_times_are_told_with_the_digits_that_tell_them_apart(step: str, line: str) -> None:
    assert told(problems(f"stop_time: 10\nstep_size: {step}\nunits: {{a: {{fmu: plant}}}}\n"), line)


@pytest.mark.parametrize(
    ("given", "line"),
    [
        (  # told to wire the aligning moment
            "PsiDot",
            "input-undriven | a.yaml:5: units.plant | plant.yaw_moment | N.m | controller.Mz | 'inputs'",
        ),
        (  # not told of the yaw rate
            "yaw_moment",
            "input-undriven | a.yaml:4: units.controller | controller.PsiDot | deg/s | plant.yaw_rate",
        ),
    ],
)
def test_an_input_is_told_of_the_output_that_means_it(given: str, line: str) -> None:
    moment = [out("Mz", unit="N.m", variability="discrete")]
    make_fmu(Path("fmus/controller_x.fmu"), inputs=[Var("PsiDot", "deg/s")], outputs=moment)
    rates = [out("sideslip_rate", unit="rad/s"), out("yaw_rate", unit="rad/s")]
    make_fmu(Path("fmus/plant_x.fmu"), inputs=[Var("yaw_moment", "N.m")], outputs=rates)
    make_fmu(Path("fmus/tyre_x.fmu"), outputs=[out("aligning_moment_*", unit="N.m")])
    units = "".join(f"  {role}: {{fmu: {role}_x}}\n" for role in ("controller", "plant", "tyre"))
    assert told(problems(f"{HEAD}units:\n{units}inputs: {{{given}: 0}}\n"), line)


@pytest.mark.parametrize("only", ["1100", "1100 kg", "[1100]", "[1100 kg, '1200']"])
def test_values_of_an_axis_are_named_as_they_are_written(only: str) -> None:
    axes = "{mass: {vary: plant.mass, unit: kg, values: [1100, 1200]}, x: {vary: inputs.x, values: [0, 1]}}"
    figure = f"{{name: a, title: A, kind: curve, metric: m, x: x, lines: mass, only: {{mass: {only}}}}}"
    Path("b.yaml").write_text(f"{SWEEP}axes: {axes}\nfigures: [{figure}]\n")
    assert load_experiment(Path("b.yaml")).spec.axes


def said_of(load: object, text: str) -> list[str]:
    Path("b.yaml").write_text(text)
    with pytest.raises(ScenarioError) as caught:
        load(Path("b.yaml"))  # type: ignore[operator]
    assert caught.value.__cause__ is None
    return [*texts_of(caught.value)]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            f"{SWEEP}axes: {{a: {{vary: plant.mass, from: 1, to: 2, count: 1000000000}}}}\n",
            "b.yaml:4: axes.a.count: ",
        ),
        (
            f"{SWEEP}axes:\n"
            + "".join(f"  a{i}: {{vary: plant.p{i}, from: 1, to: 2, count: 1000}}\n" for i in range(3)),
            "b.yaml:1: 1000000000 runs; at most 100000 are allowed",
        ),
        (
            f"{SWEEP}design: latin_hypercube\nseed: 1\npoints: 1000000000\n"
            "axes: {a: {vary: plant.mass, from: 1, to: 2}}\n",
            "b.yaml:6: points: ",
        ),
    ],
)
def test_a_sweep_of_too_many_runs_is_refused_before_they_are_listed(text: str, expected: str) -> None:
    assert said_of(load_experiment, text)[0].startswith(expected)


def test_a_study_of_too_many_runs_is_refused_before_they_are_listed() -> None:
    hundred = list(range(100))
    for_each = f"{{a: {hundred}, b: {hundred}, c: {hundred}}}"
    text = f'{STUDY}  - {{name: "{{a}}{{b}}{{c}}", scenario: a.yaml, for: {for_each}}}\n'
    assert each_mentions(said_of(load_experiment, text), ("b.yaml:4", "runs[0].for", "1000000", "10000"))
    text = STUDY + "".join(
        f'  - {{name: "{i}/{{a}}/{{b}}", scenario: a.yaml, for: {{a: {hundred}, b: {hundred}}}}}\n'
        for i in range(2)
    )
    assert each_mentions(said_of(load_experiment, text), ("b.yaml:3", "10000"))


def test_a_grid_of_too_many_cells_is_refused() -> None:
    many = list(range(200))
    text = (
        f"{STUDY}  - {{name: x, scenario: a.yaml}}\n"
        f'grids: {{g: {{title: t, metric: m, run: "{{a}}{{b}}", rows: {{a: {many}}}, '
        f"columns: {{b: {many}}}}}}}\n"
    )
    assert each_mentions(said_of(load_experiment, text), ("b.yaml:5", "grids.g", "40000", "10000"))


@pytest.mark.parametrize("text", ["a + " * 5000 + "a", "(" * 300 + "a" + ")" * 300, "-" * 390 + "a", "a\0"])
def test_an_expression_beyond_measure_is_refused_or_computed(text: str) -> None:
    try:
        Expression.parse(text)
    except ValueError as error:
        assert len(str(error)) < 200


def test_a_bad_address_in_an_ssp_archive_is_refused_with_its_line() -> None:
    ssd = (
        '<ssd:SystemStructureDescription xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription" '
        'name="x" version="1.0">\n<ssd:System name="s"><ssd:Elements>\n'
        '<ssd:Component name="a" source="http://[bad.fmu"/>\n'
        "</ssd:Elements></ssd:System></ssd:SystemStructureDescription>"
    )
    with zipfile.ZipFile("a.ssp", "w") as archive:
        archive.writestr("SystemStructure.ssd", ssd)
    with refused(ScenarioError, names=("a.ssp/SystemStructure.ssd:3", "'http://[bad.fmu'")) as caught:
        load_scenario(Path("a.ssp"))
    assert [str(one.location) for one in caught.value.diagnostics] == ["a.ssp/SystemStructure.ssd:3"]


def test_an_ssp_archive_that_unpacks_without_limit_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(zip_members, "UNPACKED", 1_000_000)
    with zipfile.ZipFile("a.ssp", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("SystemStructure.ssd", bytes(3_000_000))
    with refused(ScenarioError, "file-unreadable", names=("a.ssp", "3 MB", "1 MB")):
        load_scenario(Path("a.ssp"))


def test_what_nobody_foresaw_becomes_a_sentence_that_keeps_its_cause() -> None:
    with (
        refused(ScenarioError, "value-invalid", names=("a.yaml", "KeyError", "'secret'")) as caught,
        reading("scenario file", "a.yaml", ScenarioError),
    ):
        raise KeyError("secret")
    assert isinstance(caught.value.__cause__, KeyError)


ESCAPES = "\x1b[31mred \u202e <script>alert(1)</script>"


def test_what_an_escape_sequence_would_do_never_reaches_the_terminal(
    capsys: pytest.CaptureFixture[str],
) -> None:
    say(f"note: {ESCAPES}")
    print_tables([Table(ESCAPES, [ESCAPES], [[ESCAPES]], [ESCAPES])])
    Path("a.yaml").write_text(f"{HEAD}units: {{a: {{fmu: plant}}}}\n")
    plan = make_plan(load_scenario(Path("a.yaml")))
    show(replace(plan, title=ESCAPES), Path(f"{ESCAPES}.yaml"))
    status_of("check", f"{ESCAPES}.yaml")
    out, err = capsys.readouterr()
    assert out.count("\\x1b[31mred") == 6
    assert err.count("\\x1b[31mred") == 2
    assert not set("\x1b\u202e") & set(out + err)


def test_pages_hold_no_escape_sequences_and_no_html_of_users() -> None:
    table = Table(ESCAPES, [ESCAPES], [[ESCAPES]], [ESCAPES])
    spec = ExperimentSpec.model_validate({"title": ESCAPES, "runs": [{"name": "a", "scenario": "a.yaml"}]})
    findings = judge_results(LoadedExperiment(Path("a.yaml"), spec, {}), Path("none"))
    view = chapter(findings, command=ESCAPES, stale={}, folder=Path("none"))
    text = unpacked(render(replace(view, results=[table])))
    assert text.count("&lt;script&gt;") >= 6
    assert not set("\x1b\u202e") & set(text)
    assert "<script>alert" not in text
