"""Stage 7, see: plots of runs, pictures of mechanisms and reports."""

from linkwork.moved import leading_to
from linkwork.views.drawing import plot_mechanism
from linkwork.views.gltf import write_gltf
from linkwork.views.maps import plot_workspace
from linkwork.views.motion import plot_motion
from linkwork.views.phase import plot_phase
from linkwork.views.plots import plot_run
from linkwork.views.run_report import write_report
from linkwork.views.style import save_figure
from linkwork.views.timed import plot_timed_path
from linkwork.views.video import write_video

__all__ = [
    "plot_mechanism",
    "plot_motion",
    "plot_phase",
    "plot_run",
    "plot_timed_path",
    "plot_workspace",
    "save_figure",
    "write_gltf",
    "write_report",
    "write_video",
]

__getattr__ = leading_to(__name__, "linkwork.lab.precision", ("plot_work_precision",))
