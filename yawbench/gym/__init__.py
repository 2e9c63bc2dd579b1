"""Gymnasium environments of standard tests, for training controllers.

    import gymnasium
    import yawbench.gym

    env = gymnasium.make("yawbench/sine-with-dwell-v0")
    observation, info = env.reset(seed=1)
    observation, reward, terminated, truncated, info = env.step([0.2])

`as_controller` turns a trained policy into a controller, for `Scenario.swap` and `rank`. The package adds
nothing to the program; with its import it registers the environments in Gymnasium.
"""

try:
    import gymnasium
except ImportError:
    raise ImportError(
        'yawbench.gym needs Gymnasium: python -m pip install "yawbench[gym]"', name="gymnasium"
    ) from None

from .environment import ANGLE, ID, SCENARIO, SIGNALS, SineWithDwell, as_controller

__all__ = ["ANGLE", "ID", "SCENARIO", "SIGNALS", "SineWithDwell", "as_controller"]

if ID not in gymnasium.registry:
    gymnasium.register(id=ID, entry_point=f"{__name__}:{SineWithDwell.__name__}")
