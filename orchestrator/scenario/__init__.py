"""Scenario, vehicle and tyre property files and SSP archives, read strictly; every problem has its line.

`catalogue` finds a file by name, `loader` reads it, `schema` says what it may hold, `overrides` changes
values, `quantities` parses `90 km/h` and converts units. SSP archives become scenarios here, too.

Not here: whether an FMU has such a parameter (`wiring`).
"""
