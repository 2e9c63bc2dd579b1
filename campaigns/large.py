"""Scenarios of many units and variables, made of FMUs that are only described."""

from __future__ import annotations

from pathlib import Path

from tests.fmus.fake_fmus import Var, make_fmu, out


def write_ring(folder: Path, *, units: int, variables: int, follows: str) -> Path:
    """Write a ring of units, each fed by the one before it, and its scenario; return the scenario.

    Args:
        folder: gets `fmus/` and `ring.yaml`.
        units: how many.
        variables: of all units together, half of them inputs.
        follows: what each output follows at once: "nothing", "one" input, "all" of them, or "unsaid".
            The last unit of the ring follows nothing unless it is "unsaid", or "closed": one input each.
    """
    each = variables // units // 2
    for i in range(units):
        names = [f"u{(i - 1) % units}_y{k}" for k in range(each)]
        outputs = []
        for k in range(each):
            name, last = f"u{i}_y{k}", i == units - 1
            if follows == "unsaid":
                outputs.append(Var(name, follows=None))
            elif follows == "nothing" or (last and follows != "closed"):
                outputs.append(out(name))
            else:
                outputs.append(out(name, *(names if follows == "all" else names[k : k + 1])))
        make_fmu(folder / "fmus" / f"unit_{i}.fmu", inputs=[Var(n) for n in names], outputs=outputs)
    listed = "".join(f"  unit_{i}: {{fmu: unit_{i}}}\n" for i in range(units))
    scenario = folder / "ring.yaml"
    scenario.write_text(f"stop_time: 1\nstep_size: 0.01\nunits:\n{listed}", encoding="utf-8")
    return scenario
