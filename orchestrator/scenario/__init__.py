"""Strict reading of scenario, vehicle and tyre property files and SSP archives; problems have their line."""
