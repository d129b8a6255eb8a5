"""The C core's interface to Python: positional, strict. Users should use :mod:`beltdyn`."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any, TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str

#: Rows of the tables in ``csrc/fields.h``.
RULES: tuple[tuple[str, str, float, bool, float], ...]  # name, wording, least, excluded, most
PARAMETERS: tuple[tuple[str, str, str, str, str], ...]  # group, name, rule, unit, text
LAWS: tuple[tuple[str, str, str], ...]  # friction: name, class, text; its parameters' group: name
STATE_FIELDS: tuple[tuple[str, str, str, str], ...]  # name, size (LINKS, ...), unit, text
OUTPUTS: tuple[tuple[str, str, str, str, str], ...]  # name, group, size, unit, text
ENERGY_TERMS: tuple[tuple[str, str, str], ...]  # name, kind, text: columns of output "energy"
STATS: tuple[tuple[str, str], ...]  # name, text
ERRORS: tuple[tuple[str, int, str, str], ...]  # symbol, code, kind, text
METHODS: tuple[str, ...]  # names of the integration methods, "auto" first
#: Of the core's effects: name, and what calls for it with spaces between: groups of PARAMETERS,
#: or gravity, motion, torque, friction; empty: settling alone has it.
EFFECTS: tuple[tuple[str, str], ...]

class BeltFacts(TypedDict):
    """What there is to know of a belt model, a row of ``csrc/belts``: ``BD_BELT_FACTS``."""

    name: str
    text: str
    nodes: str  # what n_bodies counts
    note: str  # on results, or empty
    mesh: str  # of Belt
    model: str  # of Belt
    fields: tuple[str, ...]  # of its states, in STATE_FIELDS before "theta"
    lacks: tuple[str, ...]  # sizes of which it has no field and no output
    bends: int
    mounts: int
    tangents: int
    stretches: int
    at_joints: int
    flows: int  # through cells that stand still
    smooth: int
    shear: float
    reach: float
    least_span: float
    explicit_share: float
    error_by_local: float
    error_by_balance: float
    implicit_cost: float
    by_rtol: float

BELTS: tuple[BeltFacts, ...]
MAX_STRAIN: float
GRAVITY: float  # on a hung weight [N/kg]
MAX_LINKS: int

# Arguments are checked: TypeError or ValueError names the argument and its rule. What a run fails
# by is SimulationError. Arrays are new ones, states are copied.

#: Of each pulley: angle at which the belt arrives, angle over which it lies, length of the span
#: that follows, sense of the turn; then the length of the line, and its turns.
def belt_line(
    centers: ArrayLike,
    radii: ArrayLike,
    outside: Sequence[bool] | None = None,
    names: Sequence[str | None] | None = None,
) -> tuple[tuple[tuple[float, float, float, int], ...], float, int]: ...

#: How axes at the centers move with the travel: of an angle its lever [m], else 1.
def mount_directions(
    kind: str, pair: tuple[float, float], centers: ArrayLike, /
) -> NDArray[np.float64]: ...
def kernel_level() -> str: ...
def check_parameter(group: str, name: str, label: str, value: float, /) -> None: ...

#: force [N], rate of the state, and how both change: by_normal, by_state, by_slip, rate_by_normal,
#: rate_by_state, rate_by_slip; z, v [m/s], normal [N] of shape (n,). element: of a law of several.
def friction_law(
    friction: FrictionLaw,
    link_length: float,
    z: ArrayLike,
    v: ArrayLike,
    normal: ArrayLike,
    element: int = 0,
) -> dict[str, NDArray[np.float64]]: ...

#: States of a link, after a check of the numbers; 0: a function of slip velocity and normal force.
def friction_states(friction: FrictionLaw) -> int: ...

#: (n_t, n_pulleys) [N], NaN where a span has no joint between two links that touch nothing.
def span_tension(
    pulley: NDArray[np.int32], force: NDArray[np.float64], n_pulleys: int
) -> NDArray[np.float64]: ...

#: ("piecewise", t, values) | ("viscous", coefficients) | ("function", address, user_address)
#: | ("call", callable) | ("load", pulley, (coulomb, viscous, quadratic), factor)
#: | ("table", pulley, omega, torque, factor)
#: | ("harmonics", pulley, of, orders, amplitudes, phases, factor)
#: | ("curve", pulley, omega, torque, factor); factor: None or (t, factors)
TorqueTerm = tuple[Any, ...]
#: (pulley, "piecewise", t, values) | (pulley, "speed", callable) | (pulley, "angle", callable)
#: | (pulley, "crank", t, values, orders, amplitudes, phases, (fade_begin, fade_end))
MotionTerm = tuple[Any, ...]
#: name of a row of LAWS, its numbers
FrictionLaw = tuple[str, tuple[float | tuple[float, ...], ...]]
#: ("arm", pivot, numbers) | ("slider", direction, numbers) | ("path", t, displacement)
MountTerm = tuple[Any, ...]
#: name of the group of its parameters, "isolator", "clutch" or "damper", and its numbers
CouplingTerm = tuple[str, tuple[float, ...]]
#: STATE_FIELDS by name, and "t"
StateDict = Mapping[str, Any]

class Model:
    """A checked, constant scene. Raises ValueError / TypeError naming field and rule."""

    def __init__(
        self,
        belt: tuple[float, int, float, float, float, float, float],
        centers: ArrayLike,
        radii: ArrayLike,
        inertias: ArrayLike,
        contact: tuple[float, float, float, int, float],
        friction: FrictionLaw | None,
        gravity: tuple[float, float],
        drag: Sequence[tuple[float, float, float] | None] | None = None,
        pulley_friction: Sequence[FrictionLaw | None] | None = None,
        mesh: str = "paper",
        outside: Sequence[bool] | None = None,
        names: Sequence[str | None] | None = None,
        mounts: Sequence[MountTerm | None] | None = None,
        model: str = "links",
        couplings: Sequence[CouplingTerm | None] | None = None,
    ) -> None: ...
    def check_geometry(self) -> None: ...
    def centers(self, travel: ArrayLike, /) -> NDArray[np.float64]: ...
    def mount_forces(  # springs, hung weights and stops, at rest; 0 of paths
        self, travel: ArrayLike, /
    ) -> NDArray[np.float64]: ...
    def depth(  # of the belt in pulleys [m]; arrays of one shape
        self, radius: ArrayLike, tension: ArrayLike, speed: ArrayLike, /
    ) -> NDArray[np.float64]: ...
    @property
    def info(self) -> dict[str, float | int]: ...  # struct bd_info by name
    @property
    def sizes(self) -> dict[str, int]: ...  # values of fields and outputs of each size
    @property
    def belt(self) -> str: ...  # name of its row in BELTS
    @property
    def cells(self) -> NDArray[np.int32] | None: ...  # pulley of each, -1 in spans; of a belt that
    @property  # flows: else None
    def cell_shares(self) -> NDArray[np.float64] | None: ...  # of the wrap behind where it begins
    @property
    def rest(self) -> NDArray[np.float64]: ...  # travels of the mounts in equilibrium
    @property
    def mounts(self) -> tuple[dict[str, float], ...]: ...  # numbers as they act: BD_MOUNT_NUMBERS
    @property
    def couplings(self) -> tuple[dict[str, float], ...]: ...  # BD_COUPLING_NUMBERS
    @property
    def energy_terms(self) -> tuple[str, ...]: ...  # the columns of output "energy" in its runs
    @property
    def friction(self) -> tuple[tuple[str, float, float], ...]: ...  # law, kinetic, slip; by pulley
    # The Jacobian, of rate() at constant torques, takes contact and friction on the side of their
    # kinks on which the state stands; its rows and columns count the numbers of all STATE_FIELDS,
    # one field after the other. solve: k of (1 - g J) k = g c.
    def rate(self, state: StateDict, torque: ArrayLike) -> dict[str, Any]: ...
    def torques(  # as set, and speeds, those of motions, smooth from t until then, in them
        self,
        torque: Sequence[TorqueTerm],
        motion: Sequence[MotionTerm],
        t: float,
        until: float,
        theta: ArrayLike,
        omega: ArrayLike,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
    def set_going(self, state: StateDict, speed: float) -> dict[str, Any]: ...
    def observe(self, state: StateDict, /) -> dict[str, NDArray[Any]]: ...  # OUTPUTS, one row
    def solve(self, state: StateDict, g: float, c: StateDict) -> dict[str, Any]: ...
    def jacobian(  # rows, columns, values
        self, state: StateDict, /
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]: ...

class Simulation:
    """One run. Not to be advanced from two threads at once (RuntimeError).

    step: of "rk4", "lbdf2", "lie", or the first step [s]; 0: chosen, as max_step and max_steps.
    breakpoints: more times [s] at which to stop exactly. torque_interval: longest time between two
    calls of a function [s]. guards: False, to measure what they cost. Motions are called for times
    within the run, some twice.
    """

    def __init__(
        self,
        model: Model,
        state: StateDict,
        torque: Sequence[TorqueTerm],
        t_end: float,
        *,
        method: str = "auto",
        rtol: float = ...,
        step: float = 0.0,
        max_step: float = 0.0,
        max_steps: int = 0,
        ledger: bool = True,
        breakpoints: ArrayLike = (),
        torque_interval: float = ...,
        guards: bool = True,
        motion: Sequence[MotionTerm] = (),
    ) -> None: ...
    # offset (n_p, 2) [m]: the centres start displaced by this and move in during move_time [s].
    # shift: link 0 is laid this far past its place along the belt line [m]. tolerance: at rest when
    # the unbalanced force is below this times the mean tension. speed: of a belt that runs [m/s].
    @classmethod
    def settle(
        cls,
        model: Model,
        state: StateDict | None = None,
        *,
        friction: bool = False,
        free_pulleys: bool = False,
        offset: ArrayLike | None = None,
        move_time: float = 0.0,
        shift: float = 0.0,
        tolerance: float = ...,
        max_time: float = 0.0,
        speed: float = 0.0,
    ) -> Simulation: ...
    def sample(
        self, t: ArrayLike, outputs: Collection[str] | None = None
    ) -> dict[str, NDArray[Any]]:
        """Attach sample times; returns the arrays (OUTPUTS by name, and "pulley" int32) that the
        run fills row by row, NaN and -1 until then. Outputs: names of those wanted, "span_tension"
        and "across" only if named. Once, before the run; after KeyboardInterrupt again.
        """
    def advance(self, seconds: float) -> bool:
        """Run for about this much wall time [s], a step at least, and answer signals; True at the
        end of the run. The GIL is held only while a Python function is called. KeyboardInterrupt
        after stop(). An exception of a callable comes out unchanged and ends the run.
        """
    def stop(self) -> None:
        """End the run soon, from any thread: advance() raises KeyboardInterrupt, now or later."""
    @property
    def time(self) -> float: ...
    @property
    def samples(self) -> int: ...
    @property
    def method(self) -> str: ...
    @property
    def choice(self) -> str: ...
    @property
    def passes(self) -> tuple[str, ...]: ...
    @property
    def effects(self) -> tuple[int, ...]: ...  # rows of EFFECTS, in the order of the passes
    @property
    def sizes(self) -> dict[str, int]: ...  # "state" and "works": numbers; "bytes"
    @property
    def stats(self) -> dict[str, float | int]: ...
    @property
    def warnings(self) -> list[dict[str, Any]]: ...  # fields of beltdyn.RunWarning
    def state(self) -> dict[str, Any]: ...
    def export_record(self) -> bytes:
        """Return all that the run needs to continue bit for bit, in another process too."""
    def import_record(self, record: bytes | bytearray | memoryview, /) -> None:
        """Continue from a record, in a new simulation of the same model, motion and so on, whose
        sample times are set; those up to the record's time are left out.
        """
    def time_passes(self, rounds: int, /) -> list[tuple[str, float, float]]:
        """Measure the passes of a step: name, calls a step, seconds a call; ends the run. Last
        the whole step.
        """
