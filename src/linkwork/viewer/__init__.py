"""The viewer in the browser: the platform is dragged while the loops stay closed, runs are played,
forces are shown.

`session` is what happens, without a browser; `stage` and `panels` show it by viser, the optional
extra `viewer`.
"""

from linkwork.viewer.session import Session, View
from linkwork.viewer.viewer import Viewer

__all__ = ["Session", "View", "Viewer"]
