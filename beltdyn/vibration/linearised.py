"""The drive linearised at a state: its Jacobian as a sparse matrix.

The core hands it out (:meth:`beltdyn._core.Model.jacobian`), as its implicit methods have it. One
matrix gives shifts anywhere in the complex plane by a sparse LU, torques that depend on speeds,
prescribed motions, and the running belt.

Left out are the slip displacements and the angles of rims, on which nothing depends (a coupling
knows its windup), and friction states of links that
touch no pulley.

A running belt carries its links along: J is taken as they stand at one moment, in coordinates that
move with the links. In places fixed in space, which a steady belt passes with a links per second, a
small motion eta of the link at a place changes as d eta/dt = J eta - a D eta, D the derivative by
the number of the link (fourth order, of friction states second order against the belt's run, for
these begin anew where a link arrives). Pulleys and mounts stay in their places, as do the cells of
an ALE belt, of which a is 0 and J is all.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from ..base.checks import Array
from ..base.optional import scipy_module
from ..drive import cells
from ..drive.params import Params
from ..drive.route import route_at
from ..loads.torques import TorqueLike, as_terms
from ..outputs.spans import has_angles
from ..outputs.state import SIZES, SPEEDS, State

Complex = NDArray[np.complex128]

#: Share of the wave speed below which the belt is at rest.
STANDSTILL_SPEED = 1e-6
#: Of which each link, or each state of friction of a link, has one.
LINK_FIELDS = ("x", "y", "phi", "vx", "vy", "vphi", "mu")
#: Steps of the differences: of angles [rad]; of speeds [rad/s] and against the speed.
_ANGLE, _SPEED, _RELATIVE = 1e-5, 1e-4, 1e-4
#: Weights of neighbours in the derivative by the number of a link: second order against the run,
#: and fourth order.
BEHIND = {0: 1.5, -1: -2.0, -2: 0.5}
_CENTRAL = {-2: 1.0 / 12.0, -1: -2.0 / 3.0, 1: 2.0 / 3.0, 2: -1.0 / 12.0}
_BY_PLACE = {name: BEHIND if name == "mu" else _CENTRAL for name in LINK_FIELDS}


def scipy_sparse() -> tuple[Any, Any]:
    """Return scipy.sparse and scipy.sparse.linalg."""
    user = "a mode or response"
    return scipy_module("sparse", user), scipy_module("sparse.linalg", user)


@attrs.frozen(kw_only=True, eq=False)
class Linear:
    """A drive for small motions about a state: d eta/dt = J eta."""

    params: Params
    #: About which it is linearised, as the core takes it.
    state: Mapping[str, Any]
    #: J, sparse (n, n), of the unknowns that are kept, in their units.
    matrix: Any
    #: Field of :class:`beltdyn.State` of each unknown (n,), and its place there.
    names: NDArray[np.str_]
    index: NDArray[np.intp]
    #: Size of each that goes with a motion of the belt by 1 m; of velocities the same a second.
    unit: Array
    #: Links that pass a place per second, a; 0 at rest, and of cells [1/s].
    passing: float
    #: Of the belt in the order of its links [m/s], 0 at rest.
    speed: float
    #: Angular frequency from which on the mesh lacks modes across spans [rad/s].
    trusted: float
    #: Pulleys whose motion is prescribed, and paths of mounts are.
    prescribed: tuple[int, ...]
    #: Columns of J of prescribed theta and omega, for what drives the rest: sparse (n, n_p).
    given: tuple[Any, Any]
    #: Phase of the mesh of each unknown (n,), see :mod:`.mesh_phases`; None: there is one.
    phase: NDArray[np.intp] | None = None
    #: The drive linearised at each phase; empty: there is one.
    parts: tuple[Linear, ...] = ()
    #: Of the set torques, as :func:`linearise` takes them; None: they are constant.
    torque_slopes: tuple[Array, Array] | None = None

    @property
    def size(self) -> int:
        """Number of unknowns, n."""
        return int(self.names.size)

    @cached_property
    def ways(self) -> Array:
        """Unit vectors along the spans (n_p, 2)."""
        centers = self.params.centers(self.state["travel"])
        along = route_at(self.params.pulleys, centers)._ways
        return np.asarray(along / np.hypot(*along.T)[:, None])

    @cached_property
    def spans(self) -> NDArray[np.intp]:
        """Span in which each link is free (n_b,), -1 on pulleys."""
        flows = self.params._flows
        seen = self.params._cells if flows else self.params._model.observe(self.state)["pulley"][0]
        span, on = np.full(seen.size, -1), np.flatnonzero(seen >= 0)
        free = (seen < 0) & (flows | (np.roll(seen, -1) < 0))
        if on.size:  # behind the pulley that a link before it touches
            before = np.searchsorted(on, np.arange(seen.size)) - 1
            span[free] = seen[on[before]][free]
        return span

    def rows(self, name: str) -> NDArray[np.intp]:
        """Return the indices of the unknowns of a field."""
        return np.flatnonzero(self.names == name)

    def field(self, vector: Complex, name: str) -> Complex:
        """Take a field out of vectors (n, ...): all its values, 0 where they are no unknowns.

        Of several phases the mean.
        """
        rows = self.rows(name)
        out = np.zeros((np.size(self.state[name]), *vector.shape[1:]), dtype=vector.dtype)
        np.add.at(out, self.index[rows], vector[rows])
        return np.asarray(out / max(len(self.parts), 1), dtype=vector.dtype)

    def at_phase(self, vector: Complex, k: int) -> Complex:
        """Take the unknowns of ``parts[k]`` out of vectors (n, ...)."""
        return vector if self.phase is None else vector[self.phase == k]

    def norms(self, rate: float) -> Array:
        """Sizes of the unknowns in vibrations of this angular frequency [1/s]."""
        return np.where(np.isin(self.names, SPEEDS), rate, 1.0) * self.unit

    def scaled(self, rate: float) -> tuple[Array, Any]:
        """Return these sizes (n,) and the matrix (n, n) in them as units."""
        sparse, _ = scipy_sparse()
        size = self.norms(rate)
        return size, (sparse.diags(1.0 / size) @ self.matrix @ sparse.diags(size)).tocsc()

    def solver(self, rate: float) -> tuple[Array, Any, Callable[..., Any]]:
        """Return the sizes of the unknowns, i w - J in them, and what solves by it, refined."""
        sparse, linalg = scipy_sparse()
        size, scaled = self.scaled(rate)
        matrix = (1j * rate * sparse.identity(self.size) - scaled).tocsc()
        lu = linalg.splu(matrix)

        def solve(b: Any, times: int = 1) -> Any:
            x = lu.solve(np.asarray(b, dtype=complex))
            for _ in range(times):
                x += lu.solve(b - matrix @ x)
            return x

        return size, matrix, solve

    def displaced(self, eta: Array) -> dict[str, Any]:
        """Return the state moved by a small eta (n,), as the core takes it; friction as it was.

        On a friction that is nearly full a small step would be beyond what the core takes.
        """
        out = {name: np.array(value, dtype=float) for name, value in self.state.items()}
        for name in set(self.names.tolist()) - {"mu", "mount_friction"}:
            rows = self.rows(name)
            out[name][self.index[rows]] += eta[rows]
        return out | {"t": self.state["t"]}


def linearise(
    params: Params,
    state: State,
    torque_slopes: tuple[Array, Array] | None = None,
    prescribed: tuple[int, ...] = (),
    *,
    places: bool = True,
) -> Linear:
    """Linearise a drive."""
    sparse, _ = scipy_sparse()
    core = state._to_core(params)
    jacobian, names, index = _jacobian(params, core, sparse)
    unit = _units(params, names, jacobian)
    if torque_slopes is not None:
        jacobian = jacobian + _of_torques(params, names, torque_slopes, sparse)
    passing = passing_of(params, core) if places else 0.0
    speed = speed_of(params, core) if places else 0.0
    # a state of friction that no slip changes belongs to a link that touches nothing
    sums = np.asarray(abs(jacobian).sum(axis=1)).ravel()
    left_out = (names == "mu") & (sums == 0.0)
    if passing != 0.0:
        one = np.zeros(len(names), dtype=np.intp)
        jacobian = jacobian - abs(passing) * derivative(
            params, names, index, one, 1, passing, _BY_PLACE
        )
    jacobian = jacobian.tocsc()
    left_out |= np.isin(names, ["theta", "omega"]) & np.isin(index, prescribed)
    of_mounts = np.isin(names, ["travel", "travel_speed", "mount_friction"])
    left_out |= of_mounts & ~np.isin(index, [m for m, *_ in params._moving])
    inner = np.flatnonzero(~left_out)
    theta, omega = (jacobian[:, np.flatnonzero(names == of)][inner] for of in ("theta", "omega"))
    return Linear(
        params=params,
        state=core,
        matrix=jacobian[:, inner][inner].tocsc(),
        names=names[inner],
        index=index[inner],
        unit=unit[inner],
        passing=passing,
        speed=speed,
        trusted=cells.trusted(params, speed) if params._flows else np.inf,
        prescribed=prescribed,
        given=(theta, omega),
        torque_slopes=torque_slopes,
    )


def _jacobian(
    params: Params, core: Mapping[str, Any], sparse: Any
) -> tuple[Any, Any, NDArray[np.intp]]:
    """J of the unknowns that are kept, the field of each and its place in it."""
    sizes = {name: np.size(core[name]) for name in SIZES}
    names = np.concatenate([np.full(size, name, dtype="U16") for name, size in sizes.items()])
    index = np.concatenate([np.arange(size) for size in sizes.values()])
    rows, columns, values = params._model.jacobian(core)
    whole = sparse.csc_matrix((values, (rows, columns)), shape=(len(names), len(names)))
    own = params._belt_facts["fields"]
    used = [name for name, size in SIZES.items() if size != "LINKS" or name in own]
    kept = np.flatnonzero(np.isin(names, used) & ~np.isin(names, ["slip", "rim_angle"]))
    return whole[:, kept][kept], names[kept], index[kept]


def _units(params: Params, names: Any, jacobian: Any) -> Array:
    """Sizes of the unknowns at a motion of the belt by 1 m, and of velocities by 1 m/s."""
    unit, radii, at = np.ones(len(names)), params._radii, params.centers()
    levers = np.ones(len(params.mounted))
    for m, k, mount in params._moving:
        levers[m] = np.hypot(*mount._direction(at[k]))
    sizes: dict[str, Any] = dict.fromkeys(("phi", "vphi"), 2.0 / float(params.info["link_length"]))
    sizes |= dict.fromkeys(("theta", "omega"), 1.0 / radii)
    sizes |= dict.fromkeys(("travel", "travel_speed"), 1.0 / levers)
    sizes |= dict.fromkeys(("rim_speed", "windup"), 1.0 / radii[list(params.coupled)])
    for name, size in sizes.items():
        unit[names == name] = size
    # states of friction: what a slip of 1 m makes of them as it begins
    rates = np.flatnonzero(np.isin(names, SPEEDS))
    by_slip = abs(jacobian[:, rates]).multiply(unit[rates])
    largest = np.asarray(by_slip.max(axis=1).todense()).ravel()
    for name in ("mu", "mount_friction"):
        rows = names == name
        seen = largest[rows]
        top = seen.max(initial=0.0)
        unit[rows] = np.where(seen > 1e-3 * top, seen, top) if top > 0.0 else 1.0
    return unit


def _of_torques(params: Params, names: Any, slopes: tuple[Array, Array], sparse: Any) -> Any:
    inertia = params.shaft_inertias
    out = sparse.lil_matrix((len(names), len(names)))
    rows = np.flatnonzero(names == "omega")
    for name, slope in zip(("theta", "omega"), slopes, strict=True):
        out[np.ix_(rows, np.flatnonzero(names == name))] = slope / inertia[:, None]
    return out.tocsc()


def masses(params: Params, core: Mapping[str, Any]) -> dict[str, Array]:
    """Return masses and inertias that move with the speeds of a state, by field of speeds."""
    links, found = np.ones(np.size(core["x"])), {}
    found["vx"] = found["vy"] = float(params.info["link_mass"]) * links
    turning = float(params.info["link_inertia"]) if has_angles(params) else 0.0
    found |= {
        "vphi": turning * links,
        "omega": params.shaft_inertias,
        "rim_speed": params.coupled_inertias,
        "travel_speed": np.array([one["inertia"] for one in params._model.mounts]),
    }
    if params._flows:
        m, each = np.asarray(core["m"]), np.size(core["p"]) // len(params.pulleys)
        nodes, spans = 0.5 * (m + np.roll(m, 1)), 0.5 * m[params._cells < 0]
        along = spans[: np.size(core["along"])]  # what waves along spans have their ends lack
        for end in (0, 1) if along.size else ():
            nodes[np.roll(params._cells < 0, end)] -= 8.0 / np.pi**2 * along
        sizes = {"v": nodes, "p": np.repeat(spans, each), "along_speed": along}
        found |= {name: params.belt.linear_density * size for name, size in sizes.items()}
    return found


def speed_of(params: Params, core: Mapping[str, Any]) -> float:
    """Speed of the belt in the sense of its numbering [m/s], 0 if it stands still."""
    if not params._flows:
        return passing_of(params, core) * float(params.info["link_length"])
    speed = float(np.mean(core["v"]))
    return speed if abs(speed) > STANDSTILL_SPEED * params._wave_speed else 0.0


def passing_of(params: Params, core: Mapping[str, Any]) -> float:
    """Links that pass a place per second, in the sense of their numbering; 0 for cells."""
    if params._flows:
        return 0.0
    dx, dy = (np.roll(core[name], -1) - np.roll(core[name], 1) for name in ("x", "y"))
    along = (core["vx"] * dx + core["vy"] * dy) / (dx * dx + dy * dy) * 2.0
    passing = float(np.mean(along))
    slow = STANDSTILL_SPEED * params._wave_speed / float(params.info["link_length"])
    return passing if abs(passing) > slow else 0.0


def derivative(
    params: Params,
    names: Any,
    index: Any,
    phase: Any,
    phases: int,
    sense: float,
    weights: Mapping[str, Mapping[int, float]],
) -> Any:
    """D of the text at the head by the phase in the run, of fields with ``weights`` of others."""
    n, onward = params.n_bodies, 1 if sense > 0.0 else -1
    keys = list(zip(names.tolist(), index.tolist(), phase.tolist(), strict=True))
    where = {key: row for row, key in enumerate(keys)}
    rows, columns, values = [], [], []
    for row, (name, i, k) in enumerate(keys):
        for offset, value in weights.get(name, {}).items():
            passed, other = divmod(k + offset, phases)
            link = i // n * n + (i % n + onward * passed) % n if name in LINK_FIELDS else i
            column = where.get((name, link, other))
            if column is not None:
                rows.append(row)
                columns.append(column)
                values.append(value)
    return scipy_sparse()[0].csc_matrix((values, (rows, columns)), shape=(len(names), len(names)))


def torques_at(params: Params, core: Mapping[str, Any], torque: TorqueLike) -> Array:
    """Return the set torques at a state (n_p,) [N m], as the core evaluates them in a run."""
    now, terms = float(core["t"]), as_terms(torque, params.pulley_names)
    found, _ = params._model.torques(terms, (), now, now, core["theta"], core["omega"])
    return found


def torque_slopes(params: Params, state: State, torque: TorqueLike) -> tuple[Array, Array]:
    """Return the derivatives of the set torques by angles and by speeds, (n_p, n_p) each.

    By central differences, over steps of 1e-5 rad and of 1e-4 of the speed.
    """
    core, each = state._to_core(params), np.eye(len(params.pulleys))

    def slope(name: str, steps: Array) -> Array:
        ends = [
            [torques_at(params, {**core, name: core[name] + h * one}, torque) for one in each]
            for h in (steps, -steps)
        ]
        return np.asarray(((np.array(ends[0]) - ends[1]) / (2.0 * steps[:, None])).T)

    speeds = np.maximum(_SPEED, _RELATIVE * abs(core["omega"]))
    return slope("theta", np.full(len(each), _ANGLE)), slope("omega", speeds)


def balancing(params: Params, core: Mapping[str, Any], prescribed: tuple[int, ...]) -> Array:
    """Return the torques (n_p,) [N m] that hold the pulleys' speeds, 0 on those prescribed."""
    n_p = len(params.pulleys)
    rate = params._model.rate(core, np.zeros(n_p))["omega"]
    held = -rate * params.shaft_inertias
    held[list(prescribed)] = 0.0
    return np.asarray(held)
