"""Stage 6, studies: simulate a robot many times over a design of parameters, starts and
controllers, into a store.

    study = Study.load("study.yaml")
    sweep(study, "results")                       # or with scheduler="tcp://host:8786"
    xarray.open_zarr("results/results.zarr")

Needs the extra: pip install linkwork[sweeps].
"""

from linkwork.sweeps.report import Summary, summary, write
from linkwork.sweeps.runner import Outcome, sweep
from linkwork.sweeps.study import Study, StudyError

__all__ = ["Outcome", "Study", "StudyError", "Summary", "summary", "sweep", "write"]
