"""Environments for Gymnasium: episodes of a decision process, many in the lanes of vector
registers.

    import gymnasium
    import linkwork.gym

    envs = gymnasium.make_vec("Linkwork/Reach-v0", num_envs=1024)

Needs Gymnasium: pip install "linkwork[gym]".
"""

from __future__ import annotations

from linkwork.checks import imported

imported("gymnasium", 'linkwork.gym needs Gymnasium: pip install "linkwork[gym]"')

from linkwork.gym.environment import Environment  # noqa: E402
from linkwork.gym.environments import Environments  # noqa: E402
from linkwork.gym.process import DecisionProcess  # noqa: E402
from linkwork.gym.registered import register  # noqa: E402
from linkwork.gym.rolling import RollingBall  # noqa: E402
from linkwork.gym.smooth_process import SmoothProcess, smooth  # noqa: E402

__all__ = [
    "DecisionProcess",
    "Environment",
    "Environments",
    "RollingBall",
    "SmoothProcess",
    "register",
    "smooth",
]
