"""An ensemble: what do 1,000 platforms of slightly different masses do under the same forces?

Many runs at a time share the vector registers and all threads. Each has its own steps and its own
end, and comes to what it comes to alone.
"""

import matplotlib.pyplot as plt
import numpy as np

import linkwork as lw

robot = lw.Robot(lw.robots.prr3()).free("platform.mass", "link_1.mass")
random = np.random.default_rng(1)
masses = {
    "platform.mass": random.normal(1.42, 0.1, 1000),
    "link_1.mass": random.normal(0.52, 0.05, 1000),
}

t = np.linspace(0, 0.3, 31)
runs = robot.ensemble(robot.home, [1.0, 0.0, -1.0], masses, duration=0.3, save_at=t)
print(runs)

x = runs.dataset["tool_pose"].sel(pose="x").values  # (member, time)
print(f"x at the end: {1e3 * x[:, -1].mean():.3f} mm, deviation {1e3 * x[:, -1].std():.3f} mm")

# One of them by itself.
alone = robot.with_parameters({name: values[7] for name, values in masses.items()})
run = alone.simulate(robot.home, [1.0, 0.0, -1.0], duration=0.3, save_at=t)
assert np.abs(run.dataset["tool_pose"].sel(pose="x").values - x[7]).max() < 1e-10

figure, axes = plt.subplots(figsize=(6, 3.5), layout="constrained")
axes.plot(t, 1e3 * (x - x.mean(axis=0))[:60].T, color="tab:blue", alpha=0.3, linewidth=0.8)
axes.set(xlabel="t [s]", ylabel="x of the platform beside the mean [mm]")
lw.views.save_figure(figure, "ensemble.svg")
