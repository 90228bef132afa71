"""Run the examples of examples/learning, a few minutes, and draw their learning curves: python
docs/learning.py"""

import subprocess
import sys
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from linkwork.views.style import COLOURS, STYLE, svg

ROOT = Path(__file__).parents[1]
PICTURE = ROOT / "docs" / "images" / "learning.svg"
PROGRAMS = {"by_gradients": "by gradients", "ppo": "by trial and error (PPO)"}


def main() -> None:
    """Run the programs and keep their picture."""
    curves = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, label in PROGRAMS.items():
            program = ROOT / "examples" / "learning" / f"{name}.py"
            subprocess.run([sys.executable, program], cwd=folder, check=True)
            curves[label] = np.genfromtxt(Path(folder, f"learning_{name}.csv"), delimiter=",")[1:]
    PICTURE.write_text(svg(drawn(curves)), encoding="utf-8")


def drawn(curves: dict[str, np.ndarray]) -> Figure:
    """Draw mean returns over environment steps, which are powers of ten apart."""
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(6.4, 3.2), layout="constrained")
        for (label, curve), colour in zip(curves.items(), COLOURS, strict=False):
            axes.semilogx(*curve.T, color=colour, label=label)
        axes.set(xlabel="environment steps", ylabel="mean return of an episode", ylim=(45, 100))
        axes.set_title("Linkwork/Reach-v0: what the policy is worth while it learns")
        axes.legend(loc="lower right")
    return figure


if __name__ == "__main__":
    main()
