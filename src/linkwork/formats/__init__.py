"""Model files: mechanisms read from MJCF, URDF, SDF and the native YAML, and written in each.

imported = load("robot.xml")        Imported(mechanism, notes)
notes = save(imported.mechanism, "robot.yaml")
"""

from linkwork.formats.models import FORMATS, MODELS, NATIVE, OPEN, READ, Imported, load, save

__all__ = ["FORMATS", "MODELS", "NATIVE", "OPEN", "READ", "Imported", "load", "save"]
