"""Builder of FMUs from components, and their archives: found, opened, described, checked.

An `Fmu` is an FMU as plain data. `build` makes FMUs of components, in Python or C, which are written next to
this file and not kept in git; `opener` finds an FMU by name or path and builds it again if its sources have
changed; `archive` unpacks each once into a cache; `description` reads `modelDescription.xml` of FMI 2.0 and
3.0.

Not here: calling an FMU's functions (`yawbench.orchestrator.master`), wiring
(`yawbench.orchestrator.wiring`).
"""
