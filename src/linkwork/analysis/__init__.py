"""Study a robot: its branches, singularities and workspace, small motions, parameters from
measurements, statics, errors of the tool."""

from linkwork.analysis._actuation import ActuationModel, actuation
from linkwork.analysis._assembly_modes import Modes, assembly_modes, working_modes
from linkwork.analysis._base_parameters import Base, base_parameters
from linkwork.analysis._dexterity import Dexterity, dexterity, global_conditioning
from linkwork.analysis._equilibrium import Equilibrium, distributed_forces, equilibria, equilibrium
from linkwork.analysis._error_budget import Contribution, ErrorBudget, error_budget
from linkwork.analysis._jacobians import Jacobians, input_output, jacobians
from linkwork.analysis._observability import Observability, best_poses, observability
from linkwork.analysis._tensions import tensions
from linkwork.analysis._transmission_indices import TransmissionIndices, transmission_indices
from linkwork.analysis._workspace import workspace
from linkwork.analysis.calibration import Calibration, calibrate
from linkwork.analysis.error_sources import ErrorSource
from linkwork.analysis.excitation import Excitation, exciting_trajectory
from linkwork.analysis.identification import Identification, Measured, identify, periodic
from linkwork.analysis.linearisation import (
    NaturalModes,
    natural_modes,
    stiffness_matrix,
    tool_stiffness,
)
from linkwork.analysis.mapped_extent import content, inscribed
from linkwork.analysis.measured_poses import MeasuredPoses
from linkwork.analysis.plugged_tree import PluggedTree
from linkwork.analysis.possible_inertia import EstimatedPayload, payload, possible
from linkwork.analysis.singularities import Singularity, along, loci, singularity
from linkwork.model.linear_model import LinearModel, linearise
from linkwork.moved import renamed

__all__ = [
    "ActuationModel",
    "Base",
    "Calibration",
    "Contribution",
    "Dexterity",
    "Equilibrium",
    "ErrorBudget",
    "ErrorSource",
    "EstimatedPayload",
    "Excitation",
    "Identification",
    "Jacobians",
    "LinearModel",
    "Measured",
    "MeasuredPoses",
    "Modes",
    "NaturalModes",
    "Observability",
    "PluggedTree",
    "Singularity",
    "TransmissionIndices",
    "actuation",
    "along",
    "assembly_modes",
    "base_parameters",
    "best_poses",
    "calibrate",
    "content",
    "dexterity",
    "distributed_forces",
    "equilibria",
    "equilibrium",
    "error_budget",
    "exciting_trajectory",
    "global_conditioning",
    "identify",
    "input_output",
    "inscribed",
    "jacobians",
    "linearise",
    "loci",
    "natural_modes",
    "observability",
    "payload",
    "periodic",
    "possible",
    "singularity",
    "stiffness_matrix",
    "tensions",
    "tool_stiffness",
    "transmission_indices",
    "working_modes",
    "workspace",
]

__getattr__ = renamed(
    __name__, {"holding": ("linkwork.model.linear", "holding_forces", "Robot.holding_forces")}
)
