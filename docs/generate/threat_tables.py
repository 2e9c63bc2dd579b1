"""The tables of threats in docs/ranking.md from published levels: `python -m docs.generate.threat_tables`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from yawbench.foundation.messages import listed
from yawbench.ranking import threats_page
from yawbench.ranking.ranking_tables import gains_sentence, gains_table, seeds_table
from yawbench.ranking.threat_runs import ThreatResult, published_result
from yawbench.ranking.threat_scores import ScoreTable, compared_gains, resampled_scores, scored
from yawbench.ranking.threats import REFERENCE, load_threats
from yawbench.studies.confidence import percentile_bounds

from .published import markdown, replaced, wrapped

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT / "scenarios" / "proving_ground" / "threats.yaml"
PAGE = ROOT / "docs" / "ranking.md"
TUNED = "tuned "
"""Begin of the titles of tuned entries."""


def tables_text(result: ThreatResult) -> str:
    """Return all tables as Markdown, under headings of their own."""
    threats = result.threats
    scores = scored(result)
    order = scores.order()
    parts = [
        "### Who can be told apart",
        wrapped(threats_page.answer(result, scores)),
        wrapped(differences_sentences(result, scores)),
        markdown(threats_page.main_table(result, scores)),
        "Highest levels survived:",
        markdown(threats_page.levels_table(result, order)),
        "### The threats",
        markdown(threats_page.threats_table(result)),
        "### Orders without a threat or a car",
        *map(markdown, threats_page.orders_tables(result, scores)),
    ]
    gains = compared_gains(result)
    if gains:
        parts += [
            "### Gains and laws",
            wrapped(gains_sentence(gains)),
            markdown(gains_table(result, gains)),
            markdown(seeds_table(result, gains)),
        ]
    others = threats_page.compared_settings(result)
    if others:
        parts += ["### What settings change", markdown(threats_page.settings_table(result, others))]
    for name in others:
        title = threats.spec.settings[name].title
        parts += [f"### Setting: {title}", markdown(threats_page.setting_table(result, name))]
    driven = [threats_page.discipline_table(result, test) for test in threats_page.disciplines(result)]
    for table in (threats_page.overview(result, scores), *driven):
        parts += [f"### {table.title or 'All disciplines'}", markdown(table)]
    return "\n\n".join(parts)


class Differences(NamedTuple):
    """Titles by the sign of differences of scores."""

    equals: list[str]  # whom the best is not clearly better than
    helped: list[str]  # laws that gain clearly by tuning
    others: list[str]


def differences(result: ThreatResult, scores: ScoreTable) -> Differences:
    """Return whom the best is not clearly better than, and which laws gain clearly by tuning."""
    threats, titles = result.threats, threats_page.titles_of(result)
    entries = result.complete[threats.main]
    positions, none = result.positions(threats.main, entries), entries.index(REFERENCE)

    resampled = dict(zip(entries, resampled_scores(positions, none).T, strict=True))

    def clear(better: str, worse: str) -> bool:
        return bool(percentile_bounds(resampled[better] - resampled[worse])[0] > 0.0)

    best, *behind = scores.order()
    own = {titles[name]: name for name in entries}
    tuned = {title.removeprefix(TUNED): name for title, name in own.items() if title.startswith(TUNED)}
    helped = [law for law, name in tuned.items() if clear(name, own[law])]
    return Differences(
        [titles[other] for other in behind if not clear(best, other)],
        helped,
        [law for law in tuned if law not in helped],
    )


def differences_sentences(result: ThreatResult, scores: ScoreTable) -> str:
    """Return the differences in sentences."""
    best = threats_page.titles_of(result)[scores.order()[0]]
    equals, helped, others = (listed(titles) or "none" for titles in differences(result, scores))
    return (
        f"By these differences {best} is not clearly better than {equals}. Tuned gains are clearly "
        f"better than those of the study for {helped}; not for {others}."
    )


def pages_with_tables() -> dict[Path, str]:
    """Return docs/ranking.md with its tables written anew."""
    result = replace(published_result(load_threats(FILE)), published=frozenset())  # all of them are
    return {PAGE: replaced(PAGE.read_text(encoding="utf-8"), "threats", tables_text(result))}


if __name__ == "__main__":
    for page, text in pages_with_tables().items():
        page.write_text(text, encoding="utf-8")
