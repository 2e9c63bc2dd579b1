"""The tables of threats in docs/ranking.md from published levels: `python -m docs.generate.threat_tables`."""

from __future__ import annotations

import textwrap
from dataclasses import replace
from pathlib import Path

from orchestrator.experiments.ranking_tables import gains_sentence, gains_table, seeds_table
from orchestrator.experiments.tables import Table
from orchestrator.experiments.threat_runs import ThreatResult, published_result
from orchestrator.experiments.threat_scores import compared_gains, scored
from orchestrator.experiments.threats import load_threats
from orchestrator.pages import threats_page

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT / "scenarios" / "proving_ground" / "threats.yaml"
PAGE = ROOT / "docs" / "ranking.md"
BEGIN, END = "<!-- written by docs.generate.threat_tables -->", "<!-- end of tables -->"


def tables_text(result: ThreatResult) -> str:
    """Return all tables as Markdown, under headings of their own."""
    threats = result.threats
    scores = scored(result)
    order = scores.order()
    parts = [
        _wrapped(threats_page.answer(result, scores)),
        _text(threats_page.main_table(result, scores)),
        "Highest levels survived:",
        _text(threats_page.levels_table(result, order)),
        "### The threats",
        _text(threats_page.threats_table(result)),
        "### Orders without a threat or a car",
        _text(threats_page.orders_table(result, scores)),
    ]
    gains = compared_gains(result)
    if gains:
        parts += [
            "### Gains and laws",
            _wrapped(gains_sentence(gains)),
            _text(gains_table(result, gains)),
            _text(seeds_table(result, gains)),
        ]
    others = threats_page.compared_settings(result)
    if others:
        parts += ["### What settings change", _text(threats_page.settings_table(result, others))]
    for name in others:
        title = threats.spec.settings[name].title
        parts += [f"### Setting: {title}", _text(threats_page.setting_table(result, name))]
    driven = [threats_page.discipline_table(result, test) for test in threats_page.disciplines(result)]
    for table in (threats_page.overview(result, scores), *driven):
        parts += [f"### {table.title}", _text(table)]
    return "\n\n".join(parts)


def _text(table: Table) -> str:
    lines = [
        f"| {' | '.join(heading or ' ' for heading in table.headings)} |",
        f"|{'|'.join('---:' if table.is_number(k) else '---' for k in range(len(table.headings)))}|",
        *(f"| {' | '.join(cell.replace(chr(10), '; ') for cell in row)} |" for row in table.text()),
    ]
    return "\n\n".join(["\n".join(lines), *map(_wrapped, table.notes)])


def _wrapped(text: str) -> str:
    return "\n".join(textwrap.wrap(text, 118, break_on_hyphens=False))


def page_with_tables() -> str:
    """Return docs/ranking.md with its tables written anew."""
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    after = rest.partition(END)[2]
    result = replace(published_result(load_threats(FILE)), published=frozenset())  # all of them are
    return f"{before}{BEGIN}\n\n{tables_text(result)}\n\n{END}{after}"


if __name__ == "__main__":
    PAGE.write_text(page_with_tables(), encoding="utf-8")
