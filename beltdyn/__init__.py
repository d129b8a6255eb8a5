"""Dynamics of belt drives: a C core, used from Python.

The belt is a ring of rigid links joined by springs and dampers, in compliant contact with pulleys,
with Dahl friction: K. Kubas, "A model for the dynamic analysis of a belt transmission using the
Dahl friction model". SI units throughout; angles in rad, counter-clockwise positive.

::

    a drive     Params of a Belt, Pulleys, Contact, friction (Dahl, LuGre, Coulomb, ...), Drag;
                Arm, Slider, Path as mounts; route, Tensioning; a Scene has loads as well
    its loads   Motor, Load, SpeedTable, Harmonics, Step, Ramp, PiecewiseLinear, Viscous, and sums
    motions     Motion, CrankMotion, AngleTable, PiecewiseLinear
    runs        simulate, settle, resume, Checkpoint -> Result (.report(), .accuracy, .save())
    many runs   sweep, sample, sensitivity, identify
    vibration   modes, frequency_response, spectra
    what for    explain

    bd.plot     figures and films                   bd.accuracy  what accuracy costs
    bd.scenes   drives that are built in            bd.friction  the laws, compared
    bd.spectra  spectra in numbers                  bd.scenes.hard  made to break an integrator

``dir(bd)`` lists what one writes; classes that are only returned (``bd.Stats``, ``bd.Modes``) and
modules of the package are there as well.
"""

from __future__ import annotations

import sys
from importlib import import_module
from pkgutil import extend_path
from typing import TYPE_CHECKING, Any

# In a source checkout the compiled core is not beside this file but where it was installed.
__path__ = extend_path(__path__, __name__)

__version__ = "0.1.0"

try:
    from ._core import __version__ as _core_version
except ModuleNotFoundError as _error:
    if _error.name != f"{__name__}._core":
        raise
    raise ImportError(
        "the C core of beltdyn is not built: run `python -m pip install .` in the directory that "
        "holds its pyproject.toml"
    ) from None
if _core_version != __version__:
    raise ImportError(
        f"beltdyn is version {__version__} but its C core is {_core_version}: run "
        "`python -m pip install .` again"
    )

from ._moved import MOVED as _MOVED
from .base.described import describe_all as _describe_all
from .base.run_options import METHODS
from .base.run_warnings import AccuracyWarning, BeltdynWarning, RunWarning
from .drive import friction as friction
from .drive.couplings import Isolator, OverrunningClutch, TorsionalDamper
from .drive.friction import LAWS as _LAWS
from .drive.friction import (
    Coulomb,
    CreepRate,
    Dahl,
    ElasticPlastic,
    Friction,
    Frictionless,
    LuGre,
    MaxwellSlip,
    Threlfall,
)
from .drive.mounts import Arm, Path, Slider
from .drive.params import Params
from .drive.parts import Belt, Contact, Drag, Pulley
from .drive.route import Route, route
from .drive.scene import Scene
from .drive.tensioning import Tensioning
from .loads.loads import Harmonics, Load, Motor, Ramp, SpeedTable, Step
from .loads.motions import AngleTable, CrankMotion, Motion
from .loads.torques import PiecewiseLinear, Torque, TorqueSum, Viscous
from .outputs.accuracy_report import Accuracy, QuantityError
from .outputs.arcs import Arcs
from .outputs.histories import GROUPS as _GROUPS
from .outputs.histories import Stats
from .outputs.places import AlongBelt
from .outputs.state import State, Tensions
from .result.errors import Interrupted, SimulationError
from .result.result import Result
from .run.checkpoints import Checkpoint
from .run.resuming import resume
from .run.settling import settle
from .run.simulation import simulate

if TYPE_CHECKING:
    from . import accuracy as accuracy
    from . import plot as plot
    from . import scenes as scenes
    from . import spectra as spectra
    from .explaining import Explanation, explain
    from .identification import (
        Experiment,
        Free,
        Identification,
        IdentificationInterrupted,
        Target,
        identify,
    )
    from .report import Report
    from .sweeping.sampling import Samples, sample
    from .sweeping.sensitivity import Sensitivity, sensitivity
    from .sweeping.sweep import SweepInterrupted, sweep
    from .vibration.mode_set import Modes
    from .vibration.modes import modes
    from .vibration.response import FrequencyResponse, frequency_response

__all__ = [
    "METHODS",
    "Accuracy",
    "AccuracyWarning",
    "AlongBelt",
    "AngleTable",
    "Arcs",
    "Arm",
    "Belt",
    "BeltdynWarning",
    "Checkpoint",
    "Contact",
    "Coulomb",
    "CrankMotion",
    "CreepRate",
    "Dahl",
    "Drag",
    "ElasticPlastic",
    "Experiment",
    "Explanation",
    "Free",
    "FrequencyResponse",
    "Friction",
    "Frictionless",
    "Harmonics",
    "Identification",
    "IdentificationInterrupted",
    "Interrupted",
    "Isolator",
    "Load",
    "LuGre",
    "MaxwellSlip",
    "Modes",
    "Motion",
    "Motor",
    "OverrunningClutch",
    "Params",
    "Path",
    "PiecewiseLinear",
    "Pulley",
    "QuantityError",
    "Ramp",
    "Report",
    "Result",
    "Route",
    "RunWarning",
    "Samples",
    "Scene",
    "Sensitivity",
    "SimulationError",
    "Slider",
    "SpeedTable",
    "State",
    "Stats",
    "Step",
    "SweepInterrupted",
    "Target",
    "Tensioning",
    "Tensions",
    "Threlfall",
    "Torque",
    "TorqueSum",
    "TorsionalDamper",
    "Viscous",
    "__version__",
    "accuracy",
    "explain",
    "frequency_response",
    "identify",
    "modes",
    "resume",
    "route",
    "sample",
    "scenes",
    "sensitivity",
    "settle",
    "simulate",
    "spectra",
    "sweep",
]

#: Public too, but one does not write them: what functions return, and bases of classes.
_RETURNED = {
    "Accuracy",
    "AlongBelt",
    "Arcs",
    "Explanation",
    "FrequencyResponse",
    "Friction",
    "Identification",
    "Modes",
    "QuantityError",
    "Route",
    "Samples",
    "Sensitivity",
    "Stats",
    "Tensions",
    "Torque",
    "TorqueSum",
}

#: Rooms that no run needs, imported when they, or one of their names, are first asked for.
_LATE = {
    "accuracy": "",
    "explaining": "Explanation explain",
    "identification": "Experiment Free Identification IdentificationInterrupted Target identify",
    "plot": "",  # needs matplotlib
    "report": "Report",
    "scenes": "",
    "spectra": "",
    "sweeping": "Samples Sensitivity SweepInterrupted sample sensitivity sweep",
    "vibration": "FrequencyResponse Modes frequency_response modes",
}
_ROOM_OF = {name: room for room, names in _LATE.items() for name in names.split()}

_describe_all((*map(globals().get, __all__), *_GROUPS.values()))

sys.modules[f"{__name__}.friction"] = friction  # public by this name
globals().update({_law.__name__: _law for _law in _LAWS.values()})  # those without a class, too


def __dir__() -> list[str]:
    return sorted({*__all__, "friction", "plot"} - _RETURNED)


def __getattr__(name: str) -> Any:
    """Import a room when it is first asked for."""
    if name in _LATE:
        return import_module(f"{__name__}.{name}")
    if name in _ROOM_OF:
        found = globals()[name] = getattr(import_module(f"{__name__}.{_ROOM_OF[name]}"), name)
        return found
    if name in _MOVED:
        raise AttributeError(f"{__name__}.{name} has moved to {__name__}.{_MOVED[name]}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
