"""The bench: a server of results pages, and runs under sliders."""

PLUGINS = {"command": {"serve": "yawbench.bench.command:serve"}}
