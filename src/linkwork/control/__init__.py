"""Control: what acts on a robot in a simulation, compiled into its equations of motion.

def law(t, state):                          # an ordinary function, traced once with symbols
    kp = state.parameter("kp", 400.0)       # a free parameter: changed without compiling anew
    return {"slide_1": kp * (0.2 - state["slide_1"]) - 40 * state.rate("slide_1")}

robot.simulate(robot.home, law, duration=1.0, parameters={"kp": 500.0})

The classes imported here are the one list of them: studies build theirs from `LAWS` and `DRIVES`.
"""

from linkwork.control.controllers import PD, PID, ComputedTorque, PDWithGravity, SlidingMode
from linkwork.control.cylinders import HydraulicCylinder, PneumaticCylinder
from linkwork.control.drives import DCMotor, Drive, Ideal, Lag, Saturated
from linkwork.control.events import Event, limit_events, singular_events
from linkwork.control.lqr import LQR
from linkwork.control.muscles import Muscle
from linkwork.control.observation import Observation
from linkwork.control.sampler import Sampler
from linkwork.control.servos import IntegratingServo, LaggingServo, Servo
from linkwork.control.task_controllers import TaskComputedTorque, TaskPDWithGravity
from linkwork.control.wrenches import Wrench

LAWS = (
    *(PD, PDWithGravity, PID, ComputedTorque, SlidingMode, LQR),
    *(TaskPDWithGravity, TaskComputedTorque),
)
DRIVES = (
    *(Ideal, Saturated, Lag, DCMotor, HydraulicCylinder, PneumaticCylinder),
    *(Servo, LaggingServo, IntegratingServo, Muscle),
)

__all__ = [
    "LQR",
    "PD",
    "PID",
    "ComputedTorque",
    "DCMotor",
    "Drive",
    "Event",
    "HydraulicCylinder",
    "Ideal",
    "IntegratingServo",
    "Lag",
    "LaggingServo",
    "Muscle",
    "Observation",
    "PDWithGravity",
    "PneumaticCylinder",
    "Sampler",
    "Saturated",
    "Servo",
    "SlidingMode",
    "TaskComputedTorque",
    "TaskPDWithGravity",
    "Wrench",
    "limit_events",
    "singular_events",
]
