"""Tables of threats from published levels, for the pages on the ranking."""

from __future__ import annotations

from pathlib import Path

from yawbench.foundation.messages import listed
from yawbench.ranking import threat_tables as tables
from yawbench.ranking.disciplines import discipline_table, disciplines, overview
from yawbench.ranking.gains_and_laws import (
    ComparedGains,
    compared_gains,
    gains_sentence,
    gains_table,
    seeds_table,
)
from yawbench.ranking.threat_runs import ThreatResult
from yawbench.ranking.threat_scores import ScoreTable, scored
from yawbench.studies.confidence import CONFIDENCE

from .published import markdown, wrapped

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT / "scenarios" / "proving_ground" / "threats.yaml"


def tables_text(result: ThreatResult) -> str:
    """Return all tables as Markdown, under headings of their own."""
    threats = result.threats
    scores = scored(result)
    order = scores.order()
    gains = compared_gains(result)
    parts = [
        "### Who can be told apart",
        wrapped(tables.answer(result, scores)),
        wrapped(differences_sentences(result, scores, gains)),
        markdown(tables.main_table(result, scores)),
        "Highest levels survived:",
        markdown(tables.levels_table(result, order)),
        "### The threats",
        markdown(tables.threats_table(result)),
        "### Orders without a threat or a car",
        *map(markdown, tables.orders_tables(result, scores)),
    ]
    if gains:
        parts += [
            "### Gains and laws",
            wrapped(gains_sentence(result, gains)),
            markdown(gains_table(result, gains)),
            markdown(seeds_table(result, gains)),
        ]
    others = tables.compared_settings(result)
    if others:
        parts += ["### What settings change", markdown(tables.settings_table(result, others))]
    for name in others:
        title = threats.spec.settings[name].title
        parts += [f"### Setting: {title}", markdown(tables.setting_table(result, name))]
    driven = [discipline_table(result, test) for test in disciplines(result)]
    for table in (overview(result, scores), *driven):
        parts += [f"### {table.title or 'All disciplines'}", markdown(table)]
    return "\n\n".join(parts)


def differences_sentences(result: ThreatResult, scores: ScoreTable, gains: ComparedGains | None) -> str:
    """Return whom the best is not clearly better than, and which laws gain clearly by tuning."""
    titles = tables.titles_of(result)
    best, *behind = scores.order()
    equals = listed([titles[other] for other in behind if other not in scores.behind(best)]) or "none"
    sentence = f"By these differences {titles[best]} is not clearly better than {equals}."
    if gains is None:
        return sentence
    threats = result.threats
    cars = listed(threats.cars_in(gains.setting))
    better = [
        listed([titles[law] for law, p in gains.helped.items() if p[corrected] < 1.0 - CONFIDENCE]) or "none"
        for corrected in (0, 1)
    ]
    seeds = 1 + len(threats.spec.settings[gains.setting].seeds)
    return (
        f"{sentence} Tuned gains, means over {seeds} seeds of the search and on the cars that it has not "
        f"seen ({cars}), are clearly better than those of the study for {better[1]}, if corrected for the "
        f"{len(gains.means)} laws; each taken alone, for {better[0]}."
    )
