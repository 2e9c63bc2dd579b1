"""The bench: a server of results pages, and runs under sliders (`yawbench serve`)."""

PLUGINS = {"command": {"serve": "yawbench.bench.command:serve"}}
