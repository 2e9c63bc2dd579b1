"""`yawbench report`: what its page says, what it runs, how it looks in a browser and in print."""

from __future__ import annotations

import base64
import contextlib
import io
import json
import re
import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest
from lxml import html

from tests.command_line import status_of
from tests.orchestrator.recorded import record_text
from tests.refusals import each_mentions, mentions, refused
from tests.reports.browser import DESK, PHONE
from tests.reports.flaws import (
    SCREENS,
    check_budgets,
    check_first_screen,
    flaws,
    inaccessible,
    looks,
    open_all,
)  # fmt: skip
from tests.reports.made_up import HALF_A_CAR, data_in, texts, unpacked
from yawbench.foundation.errors import ScenarioError
from yawbench.metrics.verdict import Status, worded
from yawbench.reports.overview_page import held
from yawbench.reports.page_parts import with_minus
from yawbench.reports.phase_planes import PLANES
from yawbench.studies.load_experiment import found_studies, load_experiment
from yawbench.studies.result_tables import share

ROOT = Path(__file__).parents[2]
UNITS = (
    "driver_sine", "reference_single_track", "controller_off", "controller_fuzzy_feedback", "plant_two_dof",
    "tyre_magic_formula_1987",
)  # fmt: skip

HALF = """
title: Half a paper
source: Somebody, a journal
runs:
  - for: {amplitude: [0.02, 0.05]}
    name: "amplitude/{amplitude}"
    scenario: half.yaml
    set: {driver.amplitude: "{amplitude}"}
metrics:
  steer: {metric: peak(steer_angle), heading: steer angle}
tables:
  - {title: Angles, runs: ["*"], metrics: [steer]}
claims:
  - {says: More is more., source: page 1, holds_if: [{run: amplitude/0.05, metric: steer, above: 2 deg}]}
  - {says: Less is more., source: page 2, holds_if: [{run: amplitude/0.02, metric: steer, above: 2 deg}]}
"""
FIGURES = """
figures:
  - {name: angles, runs: ["*"], panels: [steer_angle, yaw_rate_ref]}
"""


@pytest.fixture
def report(fmus, capsys):
    """Call `yawbench report`; return its status and what it said."""

    def call(*arguments):
        return status_of("report", *arguments, "--fmus", fmus), capsys.readouterr().err

    return call


@pytest.fixture
def half(tmp_path, monkeypatch):
    """A working directory with one small study."""
    folder = tmp_path / "scenarios" / "half"
    folder.mkdir(parents=True)
    (folder / "study.yaml").write_text(HALF)
    (folder / "half.yaml").write_text(HALF_A_CAR)
    monkeypatch.chdir(tmp_path)
    return folder


@pytest.fixture(scope="module")
def paper(tmp_path_factory, fmus):
    """The report of paper D, and the record of its study; coarser and with fewer figures, for its page."""
    folder = tmp_path_factory.mktemp("report")
    for part in ("fuzzy_feedback", "vehicles"):
        shutil.copytree(ROOT / "scenarios" / part, folder / part)
    study, scenario = (folder / "fuzzy_feedback" / name for name in ("study.yaml", "single_sine.yaml"))
    text = scenario.read_text(encoding="utf-8")
    assert "\nstep_size: 0.001 " in text
    scenario.write_text(text.replace("\nstep_size: 0.001 ", "\nstep_size: 0.005 "), encoding="utf-8")
    before, _, rest = study.read_text(encoding="utf-8").partition("  - name: phase_portraits_without_control")
    study.write_text(before + rest[rest.index("\n# What the paper leaves open") :], encoding="utf-8")
    assert status_of("report", study, "--out", folder, "--fmus", fmus, "--format", "parquet", "--quick") == 0
    page = folder / "report.html"
    return SimpleNamespace(
        study=study,
        folder=folder,
        page=page,
        tree=html.fromstring(unpacked(page)),
        record=json.loads((folder / "experiment.json").read_text(encoding="utf-8")),
    )


def test_every_claim_stands_beside_what_was_measured_with_its_verdict(paper):
    rows = paper.tree.cssselect("table.claims > tbody > tr")
    judged = [*paper.record["claims"], *paper.record["checks"]]
    assert len(rows) == len(judged) > 4
    for row, claim in zip(rows, judged, strict=True):
        says, measured, verdict = (" ".join(cell.text_content().split()) for cell in row)
        conditions = texts(row, "details li")
        assert says.startswith(claim["says"])
        assert all(" ".join(number.split()) in measured.replace("−", "-") for number in claim["measured"])
        assert conditions == [" ".join(condition.split()) for condition in claim["holds_if"]]
        assert with_minus(f"{claim['verdict']} margin {share(claim['margin'])}") in verdict


def test_every_fmu_is_named_with_its_whole_hash(paper):
    told = set(texts(paper.tree, ".fmus td:last-child"))
    recorded = {sha for run in paper.record["runs"].values() for sha in run["fmus"].values()}
    assert told == recorded
    assert all(re.fullmatch("[0-9a-f]{64}", sha) for sha in told)


def test_every_figure_of_the_study_is_a_view_of_the_page_and_a_file(paper):
    overlays = [one for one in load_experiment(paper.study).spec.figures if one.kind == "overlay"]
    titles = [paper.record["figures"][one.name] for one in overlays]
    named = [code for code in texts(paper.tree, "details li code") if code.endswith(".svg")]
    assert [Path(file).stem for file in named] == [one.name for one in overlays]
    for file in named:
        assert (paper.folder / file).stat().st_size > 5000
        assert (paper.folder / file).with_suffix(".png").stat().st_size > 5000
    views = data_in(paper.page.read_text(encoding="utf-8"))["views"]
    assert {title for view in views for title in titles if view["title"].startswith(title)} == set(titles)
    planes = {plane.title for plane in PLANES}
    others = [view for view in views if view["title"] not in planes]
    assert all(any(view["title"].startswith(title) for title in titles) for view in others)
    assert {view["title"] for view in views} > planes


def test_the_page_answers_and_a_claim_shows_its_runs(chromium, paper):
    chromium.open(paper.page)
    chromium.wait_for("document.querySelector('.yv-ready')")
    (answer,) = texts(paper.tree, "p.said")
    claims = paper.record["claims"] or paper.record["checks"]
    holds = sum(claim["verdict"] == "holds" for claim in claims)
    assert answer.startswith(f"Of {len(claims)} ") and f"{holds} hold" in answer
    links = paper.tree.cssselect("table.claims a")
    assert len(links) == len(paper.record["claims"]) + len(paper.record["checks"])
    state = "return document.querySelector('.yv').viewer.state"
    for k in (0, len(links) - 1):
        chromium.run("document.querySelectorAll('table.claims a')[arguments[0]].click()", k)
        wanted = json.loads(re.findall(r"shown=(\[[\d,]*\])", links[k].get("href"))[0])
        text = json.dumps(wanted, separators=(",", ":"))
        chromium.wait_for(f"JSON.stringify(document.querySelector('.yv').viewer.state.shown) === '{text}'")
        assert chromium.run(state)["baseline"] == int(re.findall(r"baseline=(\d+)", links[k].get("href"))[0])
    assert chromium.console() == []


@pytest.mark.parametrize(("width", "height"), SCREENS)
def test_the_answer_and_the_first_curve_are_on_the_first_screen(chromium, paper, width, height):
    check_first_screen(chromium, paper.page, width, height)


def test_parameters_tell_their_source(paper):
    every = paper.tree.cssselect("table.parameters tbody tr")  # the vehicle's first, then those of units
    rows = {row[0].text_content(): row for row in reversed(every)}
    assert rows["mass"][1].text_content() == "1820 kg"
    assert rows["mass"].cssselect(".kind.paper")
    assert rows["sideslip_moment"].cssselect(".kind.chosen")
    assert "varied" in texts(rows["rule_table"], ".kind")
    assert rows["tyre.friction_*"][1].text_content() == "0.5, 0.4, 0.6"  # the study varies it


def test_the_page_needs_nothing_from_elsewhere(paper):
    page = unpacked(paper.page)
    assert not re.search(r"""(?:src|href)=(?!["'](?:data:|#|%23))|@import|url\((?!#|%23)|fetch\(""", page)
    assert paper.page.stat().st_size <= 2_500_000


@pytest.mark.parametrize(("width", "colours"), looks(PHONE, 768, 900, DESK, narrow=True))
def test_nothing_is_cut_overlapping_or_empty_at_any_width(chromium, paper, width, colours):
    chromium.open(paper.page, width=width)
    assert flaws(chromium) == []
    check_budgets(chromium, paper.page)
    open_all(chromium)
    assert flaws(chromium) == []
    assert inaccessible(chromium, colours) == []


def test_in_print_everything_is_unfolded(chromium, paper):
    chromium.open(paper.page)
    folded = "return document.querySelectorAll('details:not([open])').length"
    assert chromium.run(folded) > 5
    chromium.run("dispatchEvent(new Event('beforeprint'))")
    assert chromium.run(folded) == 0
    chromium.run("dispatchEvent(new Event('afterprint'))")
    assert chromium.run(folded) > 5
    pdf = base64.b64decode(chromium.driver.execute_cdp_cmd("Page.printToPDF", {})["data"])
    assert 3 < len(re.findall(rb"/Type\s*/Page\b", pdf)) < 30


def test_only_missing_or_stale_runs_are_made(report, half):
    page = Path("results/half/study/report.html")
    status, said = report()
    assert status == 0
    assert ": 2 runs\n" in said
    assert said.splitlines()[-1].startswith(f"The page: {page}")
    assert mentions(report()[1], "2 runs", "finished")
    (half / "half.yaml").write_text(HALF_A_CAR.replace("velocity_x: 20", "velocity_x: 25"))
    assert ": 2 runs\n" in report()[1]
    assert ": 2 runs\n" in report("--again")[1]


def test_after_an_edit_results_are_shown_as_stale_with_the_values_and_sources_that_they_had(report, half):
    file = half / "half.yaml"
    file.write_text(HALF_A_CAR.replace("friction: 0.7}", "friction: 0.7}  # paper A, table 1"))
    report()

    def page():
        return html.fromstring(unpacked(Path("results/half/study/report.html")))

    before = texts(page(), "table.parameters tr")
    assert any("paper A, table 1" in row for row in before)
    file.write_text(HALF_A_CAR.replace("friction: 0.7}", "friction: 0.7}  # chosen: a guess"))
    assert report()[0] == 0
    assert texts(page(), "table.parameters tr") == before
    file.write_text(HALF_A_CAR.replace("velocity_x: 20, friction: 0.7", "velocity_x: 25, friction: 0.5"))
    assert report("--no-run")[0] == 0
    tree = page()
    assert texts(tree, "table.parameters tr") == before
    assert mentions(texts(tree, ".verdict.bad"), "out of date")
    assert "✗ out of date 2 of 2 runs" in texts(tree, "summary")
    assert "amplitude/0.02: driver" in tree.text_content()


def test_a_run_that_failed_is_named_and_its_claims_are_not_judged(report, half):
    report()
    record = json.loads(Path("results/half/study/amplitude/0.05/run.json").read_text())
    record |= {"status": "failed", "error": {"message": "the wheel came off"}}
    Path("results/half/study/amplitude/0.05/run.json").write_text(record_text(record))
    assert report("--no-run")[0] == 1
    tree = html.fromstring(unpacked(Path("results/half/study/report.html")))
    assert mentions(tree.text_content(), "wheel", "came")
    verdicts = [text.split(maxsplit=1)[1] for text in texts(tree, "table.claims .verdict")]
    assert verdicts == ["not judged", "does not reproduce"]


@pytest.fixture(scope="module")
def overview(tmp_path_factory, fmus):
    """The folder that `yawbench report` makes of three studies, in a place of its own, and what it said."""
    folder = tmp_path_factory.mktemp("overview")
    (scenarios := folder / "scenarios").mkdir()
    before = (HALF + FIGURES).replace("Half a paper", "A paper before")
    for name, studies in (
        ("half", {"study": HALF + FIGURES}),
        ("whole", {"study": before, "extra": HALF.replace("Half a paper", "A paper before, more")}),
    ):
        (scenarios / name).mkdir()
        (scenarios / name / "half.yaml").write_text(HALF_A_CAR)
        for file, text in studies.items():
            (scenarios / name / f"{file}.yaml").write_text(text)
    said = io.StringIO()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stderr(said):
        patch.chdir(folder)
        assert status_of("report", "--fmus", fmus) == 0
    results = shutil.move(folder / "results", folder / "copied")  # the folder is all that is needed
    shutil.rmtree(scenarios)
    return SimpleNamespace(folder=results, said=said.getvalue())


def test_several_studies_make_one_page_with_an_overview(overview):
    assert mentions(overview.said.splitlines()[-1].partition(" (")[0], "results/report.html", "page")
    tree = html.fromstring(unpacked(overview.folder / "report.html"))
    titles = ["A paper before", "A paper before, more", "Half a paper"]
    assert texts(tree, "section > h2") == titles
    claims = len(tree.cssselect("ol.plain > li"))
    assert tree.xpath("string(//p[@class='said'])").startswith(f"Of {claims} claims in 3 studies, ")
    assert texts(tree, "table.papers tbody th") == titles
    assert len(tree.cssselect("table.papers tbody .verdict")) == claims
    for title, link in zip(titles, tree.cssselect("section > h2 > a"), strict=True):
        page = overview.folder / link.get("href")
        study = html.fromstring(unpacked(page))
        assert study.findtext(".//h1") == title
        places = {element.get("id") for element in study.cssselect("[id]")}
        links = {link.get("href")[1:].partition("?")[0] for link in study.cssselect("a[href^='#']")}
        assert links <= places
        for file in (code for code in texts(study, "details li code") if code.endswith(".svg")):
            assert (page.parent / file).is_file()
    assert len([*(overview.folder / "data").glob("*.js")]) == 3


def test_checks_that_were_not_judged_are_not_counted_among_those_that_do_not_hold():
    one = {status: worded(status, "checks") for status in Status}
    assert held([one[Status.NOT_JUDGED]] * 2) == "2 not judged"
    assert held([one[Status.PASSED], one[Status.FAILED], one[Status.NOT_JUDGED]]) == "1 of 2, 1 not judged"
    assert (held([one[Status.PASSED], one[Status.SENSITIVE]]), held([])) == ("1 of 2", "")


@pytest.mark.parametrize(("width", "colours"), looks(PHONE, DESK, narrow=False))
def test_a_claim_of_the_overview_shows_its_runs_from_the_side_file_of_its_study(
    chromium, overview, width, colours
):
    page = overview.folder / "report.html"
    assert page.stat().st_size < 250_000
    chromium.open(page, width=width)
    chromium.wait_for("document.querySelector('.choosing').dataset.shown === 'whole-study'")
    chromium.wait_for("document.querySelector('.chosen .yv-ready')")
    assert chromium.run("return document.querySelectorAll('*').length") <= 2000
    claims = "document.querySelectorAll('ol.plain > li').length"
    chromium.wait_for(f"{claims} === 2")  # of the shown study alone: those of all would be too many elements
    links = chromium.run(
        "return [...document.querySelectorAll('table.papers a.verdict')].map((one) => one.hash)"
    )
    assert len(links) == 6
    for link in (links[5], links[4], links[1]):
        wanted = re.findall(r"shown=(\[[\d,]*\])", link)[0]
        study = re.findall(r"id=([\w-]+)", link)[0]
        chromium.run("document.querySelector(`a[href='${arguments[0]}']`).click()", link)
        chromium.wait_for(f"document.querySelector('.choosing').dataset.shown === '{study}'")
        chromium.wait_for("document.querySelector('.chosen .yv-ready')")
        shown = "JSON.stringify(document.querySelector('.chosen .yv').viewer.state.shown)"
        chromium.wait_for(f"{shown} === '{wanted}'")
        chromium.wait_for(f"document.querySelectorAll('#{study} ol.plain > li').length === 2")
        opened = "return [...document.querySelectorAll('section > details[open]')]"
        assert chromium.run(f"{opened}.map((one) => one.parentElement.id)") == [study]
    assert all(one.startswith("file://") for one in chromium.requests())
    assert [one for one in flaws(chromium) if not one.startswith("fetched")] == []
    assert inaccessible(chromium, colours) == []


def test_studies_that_would_share_a_results_folder_are_refused(report, half):
    other = half.parent / "elsewhere" / half.name
    shutil.copytree(half, other)
    files = [str((folder / "study.yaml").relative_to(Path.cwd())) for folder in (half, other)]
    status, said = report(*files)
    assert status == 2
    assert mentions(
        said, "scenarios/half/study.yaml", "scenarios/elsewhere/half/study.yaml", "results/half/study"
    )


def test_the_four_papers_are_found_in_their_order_and_what_goes_beyond_them_after(monkeypatch):
    monkeypatch.chdir(ROOT)
    found = [path.relative_to("scenarios").as_posix() for path in found_studies()]
    papers = ("fnn_sideslip/study", "fnn_sideslip/laws", "fuzzy_sliding_mode/study",
              "fuzzy_sliding_mode/distribution", "fuzzy_pid/study", "fuzzy_feedback/study")  # fmt: skip
    assert found[:6] == [f"{name}.yaml" for name in papers]
    assert {"real_signals/latency.yaml", "lqg/study.yaml", "proving_ground/esc.yaml"} <= {*found[6:]}


def test_without_any_study_it_says_where_it_looked(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with refused(ScenarioError, "file-wrong-kind", names=("*", "study", "file")):
        found_studies()


def test_two_wishes_that_exclude_each_other_are_refused(report, half):
    assert each_mentions(
        report("--again", "--no-run"), ("2",), ("--fresh", "--no-run", "mutually", "exclusive")
    )
