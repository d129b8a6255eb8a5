"""The drive linearised at a state: its Jacobian as a sparse matrix.

The core hands it out (:meth:`beltdyn._core.Model.jacobian`), as its implicit methods have it. One
matrix gives shifts anywhere in the complex plane by a sparse LU, torques that depend on speeds,
prescribed motions, and the running belt. Left out are the slip displacements and the angles of
rims, on which nothing depends (a coupling knows its windup), and friction states of links that
touch no pulley.

A running belt carries its links along: J is taken as they stand at one moment, in coordinates that
move with the links. In places fixed in space, which a steady belt passes with a links per second, a
small motion eta of the link at a place changes as d eta/dt = J eta - a D eta, D the derivative by
the number of the link (fourth order, of friction states second order against the belt's run, for
these begin anew where a link arrives). Pulleys and mounts stay in their places, as do the cells of
an ALE belt, of which a is 0 and J is all.

The links that touch a pulley, and where the last of them stands against the point where the belt
leaves, are those of one moment; a belt that runs passes through all such phases of its mesh while
it moves on by a link. A small motion about it is then eta_i(t) = xi_i(t) exp(lambda t), xi the same
again after the time 1 / a of a passing, when link i stands where link i + 1 has stood (Floquet):

    lambda xi_i,k = J_k xi_i,k - a K (D xi)_i,k,    k = 0 ... K - 1 phases,

one linear system of K times the size, D the derivative by the number i K + k, second order against
the run; of pulleys and mounts by k alone, round a passing. Of its eigenvalues lambda + 2 pi i m a
belong to one mode; that with m = 0 is the one of which the mean over the phases moves.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
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
_BEHIND = {-2: 0.5, -1: -2.0, 0: 1.5}
_CENTRAL = {-2: 1.0 / 12.0, -1: -2.0 / 3.0, 1: 2.0 / 3.0, 2: -1.0 / 12.0}


def scipy_sparse() -> tuple[Any, Any]:
    """Return scipy.sparse and scipy.sparse.linalg."""
    user = "a mode or response"
    return scipy_module("sparse", user), scipy_module("sparse.linalg", user)


@attrs.frozen(kw_only=True, eq=False)
class Linear:
    """A drive for small motions about a state, or over phases of its mesh: d eta/dt = J eta."""

    params: Params
    #: About which it is linearised, one for each phase, as the core takes them.
    states: tuple[Mapping[str, Any], ...]
    #: J, sparse (n, n), of the unknowns that are kept, in their units.
    matrix: Any
    #: Field of :class:`beltdyn.State` of each unknown (n,), its place there, and its phase.
    names: NDArray[np.str_]
    index: NDArray[np.intp]
    phase: NDArray[np.intp]
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
    #: Of the set torques, as :func:`linearise` takes them; None: they are constant.
    torque_slopes: tuple[Array, Array] | None = None

    @property
    def size(self) -> int:
        """Number of unknowns, n."""
        return int(self.names.size)

    @property
    def state(self) -> Mapping[str, Any]:
        """The state at the first phase."""
        return self.states[0]

    @cached_property
    def parts(self) -> tuple[Linear, ...]:
        """The unknowns of each phase, itself if there is one."""
        if len(self.states) == 1:
            return (self,)
        return tuple(
            attrs.evolve(self, states=(state,), **{of: getattr(self, of)[self.phase == k]
                         for of in ("names", "index", "phase", "unit")})
            for k, state in enumerate(self.states)
        )  # fmt: skip

    @cached_property
    def masses(self) -> dict[str, Array]:
        """Masses and inertias that move with each field of speeds."""
        return masses(self.params, self.state)

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
        return np.asarray(out / len(self.states), dtype=vector.dtype)

    def filled(self, values: Mapping[str, Any]) -> Any:
        """Return a vector (n,) from values of fields, 0 of others."""
        out = np.zeros(self.size, dtype=np.result_type(float, *values.values()))
        for name, of_field in values.items():
            rows = self.rows(name)
            out[rows] = of_field[self.index[rows]]
        return out

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
    states: State | Sequence[State],
    torque_slopes: tuple[Array, Array] | None = None,
    prescribed: tuple[int, ...] = (),
    *,
    places: bool = True,
) -> Linear:
    """Linearise a drive at a state, or over the phases of a passing, as the head says."""
    sparse, _ = scipy_sparse()
    cores = [one._to_core(params) for one in ([states] if isinstance(states, State) else states)]
    phases, first = len(cores), cores[0]
    sizes = {name: np.size(first[name]) for name in SIZES}
    names = np.concatenate([np.full(size, name, dtype="U16") for name, size in sizes.items()])
    index = np.concatenate([np.arange(size) for size in sizes.values()])
    own = params._belt_facts["fields"]
    used = {name for name, size in SIZES.items() if size != "LINKS" or name in own}
    kept = np.flatnonzero(np.isin(names, sorted(used - {"slip", "rim_angle"})))
    whole = len(names)
    names, index = names[kept], index[kept]
    fixed = np.isin(names, ["theta", "omega"]) & np.isin(index, prescribed)
    of_mounts = np.isin(names, ["travel", "travel_speed", "mount_friction"])
    fixed |= of_mounts & ~np.isin(index, [m for m, *_ in params._moving])
    blocks, units, inner = [], [], []
    for core in cores:
        rows, columns, values = params._model.jacobian(core)
        block = sparse.csc_matrix((values, (rows, columns)), shape=(whole, whole))[:, kept][kept]
        units.append(_units(params, names, block))
        if torque_slopes is not None:
            block = block + _of_torques(params, names, torque_slopes, sparse)
        # a state of friction that no slip changes belongs to a link that touches nothing
        idle = (names == "mu") & (np.asarray(abs(block).sum(axis=1)).ravel() == 0.0)
        inner.append(~(fixed | idle))
        blocks.append(block)
    kept = np.flatnonzero(np.concatenate(inner))
    jacobian = sparse.block_diag(blocks, format="csc") if phases > 1 else blocks[0].tocsc()
    given = [
        sparse.vstack([block[:, np.flatnonzero(names == of)] for block in blocks]).tocsc()[kept]
        for of in ("theta", "omega")
    ]
    passing = passing_of(params, first) if places else 0.0
    speed = speed_of(params, first) if places else 0.0
    if passing != 0.0:
        along = _along_run(params.n_bodies, names, index, phases, passing)
        jacobian = jacobian - abs(passing) * phases * along
    phase = np.repeat(np.arange(phases), len(names))
    return Linear(
        params=params,
        states=tuple(cores),
        matrix=jacobian.tocsc()[:, kept][kept].tocsc(),
        names=np.tile(names, phases)[kept],
        index=np.tile(index, phases)[kept],
        phase=phase[kept],
        unit=np.concatenate(units)[kept],
        passing=passing,
        speed=speed,
        trusted=cells.trusted(params, speed) if params._flows else np.inf,
        prescribed=prescribed,
        given=(given[0], given[1]),
        torque_slopes=torque_slopes,
    )


def _along_run(n: int, names: Any, index: Any, phases: int, passing: float) -> Any:
    """D of the text at the head, by the number of the link and its phase, in the belt's run."""
    onward, links = 1 if passing > 0.0 else -1, np.isin(names, LINK_FIELDS)
    phase, unknown = np.divmod(np.arange(phases * len(names)), len(names))
    behind = (names == "mu") | (phases > 1)
    rows, columns, values = [], [], []
    for offset in (-2, -1, 0, 1, 2):
        weights = np.where(behind, _BEHIND.get(offset, 0.0), _CENTRAL.get(offset, 0.0))
        weights[~(links | behind)] = 0.0
        passed, other = np.divmod(phase + offset, phases)
        link = index[unknown] % n
        moved = np.where(links[unknown], (link + onward * passed) % n - link, 0)
        there = np.flatnonzero(weights[unknown])
        rows.append(there)
        columns.append((other * len(names) + unknown + moved)[there])
        values.append(weights[unknown][there])
    at = np.concatenate(rows), np.concatenate(columns)
    shape = (len(phase), len(phase))
    return scipy_sparse()[0].csc_matrix((np.concatenate(values), at), shape=shape)


def levers(params: Params, travel: Any = None) -> dict[str, Array]:
    """Return the motion of the belt [m] that goes with each pulley, rim and mount, by its speed."""
    radii, centers = params._radii, params.centers(travel)
    mounts = np.ones(len(params.mounted))
    for m, k, mount in params._moving:
        mounts[m] = np.hypot(*mount._direction(centers[k]))
    return {"omega": radii, "rim_speed": radii[list(params.coupled)], "travel_speed": mounts}


def _units(params: Params, names: Any, jacobian: Any) -> Array:
    """Sizes of the unknowns at a motion of the belt by 1 m, and of velocities by 1 m/s."""
    unit, lever = np.ones(len(names)), levers(params)
    sizes: dict[str, Any] = dict.fromkeys(("phi", "vphi"), 2.0 / float(params.info["link_length"]))
    sizes |= {speed: 1.0 / each for speed, each in lever.items()}
    for name, speed in (("theta", "omega"), ("travel", "travel_speed"), ("windup", "rim_speed")):
        sizes[name] = sizes[speed]
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
