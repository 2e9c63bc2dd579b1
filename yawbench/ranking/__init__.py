"""Rankings of controllers under many conditions, and by threats that are turned up.

`ranking*` is the matrix of conditions, `threat*` the search for the highest level survived. Files
`ranking.yaml` and `threats.yaml`, runs, scores, tables, pages, `yawbench rank` and `yb.rank`.
"""

PLUGINS = {
    "command": {"rank": "yawbench.ranking.command:rank"},
    "kind of file": {
        "ranking": "yawbench.ranking.ranking:RankingSpec",
        "entries": "yawbench.ranking.ranking:EntriesSpec",
        "threats": "yawbench.ranking.threats:ThreatsSpec",
    },
    "library": {"Ranking": "yawbench.ranking.library:Ranking", "rank": "yawbench.ranking.library:rank"},
    "use of a tuning": {"entries": "yawbench.ranking.tuned_entries:write_entries"},
}
