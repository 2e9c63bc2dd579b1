"""Interoperability: SSP export, and the same scenario run by other co-simulation masters."""

PLUGINS = {
    "command": {
        "export-ssp": "yawbench.interop.command:export_ssp",
        "second-opinion": "yawbench.interop.command:second_opinion",
    }
}
