"""A lane change under sliders: speed, friction and steering.

marimo edit notebooks/sliders.py     with its code
marimo run notebooks/sliders.py      as a page
python notebooks/sliders.py          once, at the first positions of the sliders
"""

import marimo

__generated_with = "0.25.2"
app = marimo.App(width="medium", app_title="A car under sliders")


@app.cell
def _():
    import marimo as mo
    import numpy as np

    import yawbench as yb

    return mo, np, yb


@app.cell
def _(mo):
    mo.md("""
    # How much control is enough?

    One sine of the steering, driven with and without control. Every move of a slider runs the car anew.
    """)
    return


@app.cell
def _(mo):
    shown = {"show_value": True, "debounce": True}  # a run begins when the slider is let go
    speed = mo.ui.slider(10, 45, value=25, label="speed in m/s", **shown)
    friction = mo.ui.slider(0.2, 1.0, step=0.05, value=0.65, label="friction", **shown)
    steering = mo.ui.slider(0.01, 0.1, step=0.0025, value=0.0325, label="steering in rad", **shown)
    controller = mo.ui.dropdown(
        ["controller_fnn", "controller_fuzzy_sideslip", "controller_pid", "controller_sliding_mode"],
        value="controller_fnn",
        label="controller",
    )
    mo.vstack([speed, friction, steering, controller])
    return controller, friction, speed, steering


@app.cell
def _(controller, friction, speed, steering, yb):
    scenario = yb.load("fnn_sideslip/25mps").set(
        {
            "speed": speed.value,
            "friction": friction.value,
            "driver.amplitude": steering.value,
        }
    )
    runs = {
        "no control": scenario.swap(controller="controller_off").run(),
        controller.value: scenario.swap(controller=controller.value).run(),
    }
    return (runs,)


@app.cell
def _(mo, np, runs):
    peaks = {name: np.degrees(run.metric("peak(sideslip)")) for name, run in runs.items()}
    stats = [mo.stat(f"{peak:.1f}°", label=name, caption="largest sideslip") for name, peak in peaks.items()]
    mo.hstack(stats, justify="start")
    return


@app.cell
def _(runs, yb):
    yb.view(runs, "sideslip", "yaw_rate", height=600)
    return


if __name__ == "__main__":
    app.run()
