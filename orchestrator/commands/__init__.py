"""The subcommands of `yawbench`, one module each."""
