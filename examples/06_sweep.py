"""A sweep: a study of many runs that survives interruptions, from a file.

The same file is what `linkwork sweep study.yaml` takes. Interrupted, it goes on where it was.
"""

from pathlib import Path

from linkwork import sweeps

Path("study.yaml").write_text("""\
study: 1
name: hold a pose
robot: prr3
duration: 0.5
start: {tool: [0.5, 0.288, 0.5]}
controllers:
  pd:
    type: pd
    kp: 4000
    kd: 150
    goal: {type: pose, tool: [0.55, 0.288, 0.5]}
design: {type: sobol, members: 256, seed: 1}
vary:
  platform.mass: {type: normal, mean: 1.4, deviation: 0.1, low: 1}
  controllers.pd.kp: {type: log_uniform, low: 1000, high: 10000}
outputs:
  peak_force: peak actuator_force.slide_1
  error: final tool_error.x
""")
study = sweeps.Study.load("study.yaml")
outcome = sweeps.sweep(study, "results")
found = sweeps.summary(outcome.store)
for row in found.rows:
    between = f"{row.least:.3g} to {row.largest:.3g}"
    print(f"{row.output} [{row.unit}]: {row.mean:.3g} on average, {between}")

# Once more: everything is there already.
assert sweeps.sweep(study, "results").computed == 0

# Table and plots, as the command line writes them.
for path in sweeps.write(outcome.store, found, Path("results")):
    print(path)
Path("results/plots.svg").replace("sweep.svg")
