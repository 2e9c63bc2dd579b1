"""The built docs: complete, self-contained, every link leading somewhere."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import pytest
import typer

from docs.generate import schemas
from docs.generate.formulas import to_mathml
from docs.generate.text import docstring, table
from tests.checkout import ROOT
from yawbench.cli import _application
from yawbench.fmus.archive import open_fmu
from yawbench.fmus.build import find_components
from yawbench.foundation.messages import fold
from yawbench.metrics.measures import MEASURES
from yawbench.orchestrator.scenario.schema import ScenarioSpec
from yawbench.studies.load_experiment import ExperimentFile
from yawbench.vocabulary.signals import SIGNALS


class Page(HTMLParser):
    """Links, loaded files and anchors of a page."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loads: list[str] = []
        self.anchors: set[str] = set()
        self.feed(file.read_text("utf-8"))

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        given = {key: value or "" for key, value in attributes}
        self.anchors |= {given[key] for key in ("id", "name") if key in given}
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        elif tag == "link" and given.get("rel") in ("stylesheet", "icon", "preload"):
            self.loads.append(given["href"])
        elif "src" in given:
            self.loads.append(given["src"])


@pytest.fixture(scope="module")
def pages(site):
    return {file.relative_to(site): Page(file) for file in site.rglob("*.html") if file.name != "404.html"}


def text_of(site, name):
    return (site / name).read_text("utf-8")


def test_every_page_of_the_docs_is_in_the_menu_and_built(site, pages):
    written = {file.relative_to(ROOT / "docs") for file in (ROOT / "docs").rglob("*.md")}
    assert len(written) > 10
    assert {path.with_suffix(".html") for path in written} <= set(pages)
    assert not list(site.rglob("*.py"))


def test_every_link_between_pages_leads_somewhere(site, pages):
    checked = 0
    for path, page in pages.items():
        for link in page.links:
            target, _, anchor = unquote(link).partition("#")
            if re.match(r"[a-z]+:", target):
                continue
            file = (site / path.parent / target).resolve() if target else (site / path).resolve()
            assert file.exists(), f"{path}: {link}"
            if anchor and file.suffix == ".html":
                name = file.relative_to(site.resolve())
                assert anchor in pages[name].anchors, f"{path}: {link}"
            checked += 1
    assert checked > 100


def test_nothing_is_loaded_from_elsewhere(site, pages):
    assert [load for page in pages.values() for load in page.loads if "//" in load] == []
    styles = "".join(file.read_text("utf-8") for file in site.rglob("*.css"))
    assert re.findall(r"url\([\"']?https?:|@import", styles) == []


def test_every_formula_is_drawn_without_a_script(site, pages):
    for letter in "abcd":
        html = text_of(site, f"theory/paper_{letter}.html")
        assert html.count("<math") > 5
        assert "arithmatex" not in html
    assert not any("\\frac" in text_of(site, path) for path in pages)


def test_a_formula_that_cannot_be_shown_fails_the_build():
    with pytest.raises(ValueError, match="this formula cannot be shown"):
        to_mathml(r'<span class="arithmatex">\(\left( a\)</span>')


def test_the_reference_of_units_tells_every_variable_of_every_fmu(site):
    html = text_of(site, "reference/units.html")
    for name in find_components():
        section = html.partition(f'<h3 id="{name}">')[2].partition("<h3")[0]
        variables = open_fmu(ROOT / "fmus" / f"{name}.fmu").variables
        for shown in fold(list(variables)):
            assert f"<code>{shown}</code>" in section, f"{name}: {shown}"


def test_the_reference_of_commands_tells_every_option(site):
    html = text_of(site, "reference/commands.html")
    group = typer.main.get_command(_application())
    for name, command in group.commands.items():
        section = html.partition(f'<h2 id="yawbench-{name}">')[2].partition("<h2")[0]
        for parameter in command.params:
            if parameter.param_type_name == "option" and parameter.name != "help":
                assert parameter.opts[0] in section, f"{name} {parameter.opts[0]}"


@pytest.mark.parametrize(("page", "root"), [("scenario", ScenarioSpec), ("experiment", ExperimentFile)])
def test_the_references_of_files_tell_every_key(site, page, root):
    html = text_of(site, f"reference/{page}.html")
    models = schemas.reachable([root])
    assert root in models
    for model in models:
        section = html.partition(f'<h2 id="{schemas.title(model).lower()}">')[2].partition("<h2")[0]
        for name, field in model.model_fields.items():
            assert f"<code>{field.alias or name}</code>" in section, f"{model.__name__}.{name}"
        assert "any value" not in section


def test_the_references_of_metrics_and_signals_are_whole(site):
    metrics, signals = text_of(site, "reference/metrics.html"), text_of(site, "reference/signals.html")
    assert [name for name in MEASURES if f"<code>{name}</code>" not in metrics] == []
    assert [name for name in SIGNALS if f"<code>{name}</code>" not in signals] == []


def test_plain_text_is_not_read_as_markup():
    assert docstring("Of x_* and y_*:\n    a_* = [1]\nand `b_*`.") == (
        "Of x\\_\\* and y\\_\\*:\n\n    a_* = [1]\nand `b_*`.\n"
    )
    assert table(("a",), []) == ""


def test_the_docs_name_nothing_that_is_not_in_the_repository():
    for file in [*(ROOT / "docs").rglob("*.md"), ROOT / "README.md"]:
        for path in re.findall(
            r"`((?:components|foundation|fmus|orchestrator|scenarios|tests|yawbench)/[\w/.]+?\.\w+)`",
            file.read_text("utf-8"),
        ):
            made_by_reader = ("yaw_follow", "slip_guard", "how_fast", "how_gentle", "yaw_rate.py")
            if not any(word in path for word in made_by_reader) and not path.endswith(".fmu"):
                assert (ROOT / path).exists(), f"{file.name}: {path}"


def test_alerts_of_github_are_boxes_with_titles(site, pages):
    written = {
        file.relative_to(ROOT / "docs").with_suffix(".html"): file.read_text("utf-8").count("> [!")
        for file in (ROOT / "docs").rglob("*.md")
    }
    boxed = {path: text_of(site, path).count('class="admonition ') for path in pages}
    assert sum(written.values()) > 10
    assert {path: boxed[path] for path in written} == written
    assert not [
        path for path in pages if "[!" in re.sub(r"<pre.*?</pre>", "", text_of(site, path), flags=re.DOTALL)
    ]
    assert '<p class="admonition-title">What is lost</p>' in text_of(site, "theory/paper_d.html")
