"""Interoperability: export as SSP and as one FMU; the same scenario run by other co-simulation masters.

Not here: reading SSP archives (`yawbench.orchestrator.scenario`).
"""

PLUGINS = {
    "command": {
        "dbc": "yawbench.interop.command:dbc",
        "export-can": "yawbench.interop.command:export_can",
        "export-fmu": "yawbench.interop.command:export_fmu",
        "export-ssp": "yawbench.interop.command:export_ssp",
        "second-opinion": "yawbench.interop.command:second_opinion",
    }
}
