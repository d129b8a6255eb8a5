"""What moves in a mode: shares of the kinetic energy, and a name for it.

The kinetic energy of a mode, as the mean over a period, is split into that of the belt across each
span, of each pulley's rotation, of each mount, and of the belt otherwise: along itself, and where
it lies on pulleys.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from ..base.checks import Array
from ..base.naming import span_names
from ..result.labelled import mount_kinds
from .linearised import Complex, Linear

#: Share from which on a part is named second, and displacement that counts for a node.
SECOND, NODE = 0.2, 0.05
_ORDINALS = {1: "1st", 2: "2nd", 3: "3rd"}


@attrs.frozen(kw_only=True, eq=False)
class Participation:
    """Shares of the kinetic energy in modes, each row with the sum 1.

    Attributes:
        spans: Share of the belt across its free span after each pulley (n, n_p).
        pulleys: Share of the rotation of each pulley (n, n_p).
        mounts: Share of each mount (n, n_m): the arm or the carriage with the pulley on it.
        belt: Share of the belt otherwise (n,): along itself, and on the pulleys.
    """

    spans: Array
    pulleys: Array
    mounts: Array
    belt: Array


def participation(linear: Linear, vectors: Complex) -> Participation:
    """Split the kinetic energies of modes (size, n)."""
    energy = {
        name: (each[:, None] * abs(linear.field(vectors, name)) ** 2).T
        for name, each in linear.masses.items()
    }
    n_p, n = len(linear.params.pulleys), vectors.shape[1]
    if linear.params._flows:
        across = energy["p"].reshape(n, n_p, energy["p"].shape[1] // n_p).sum(axis=2)
        belt = energy["v"].sum(axis=1) + energy["along_speed"].sum(axis=1)
    else:
        vx, vy = (linear.field(vectors, name) for name in ("vx", "vy"))
        across = np.zeros((n, n_p))
        for k in range(n_p):
            free, (x, y) = linear.spans == k, linear.ways[k]
            normal = x * vy[free] - y * vx[free]
            across[:, k] = float(linear.params.info["link_mass"]) * np.sum(abs(normal) ** 2, axis=0)
        belt = sum(energy[name].sum(axis=1) for name in ("vx", "vy", "vphi")) - across.sum(axis=1)
    turns, moved = energy["omega"], energy["travel_speed"]
    for c, k in enumerate(linear.params.coupled):
        turns[:, k] += energy["rim_speed"][:, c]
    total = belt + across.sum(axis=1) + turns.sum(axis=1) + moved.sum(axis=1)
    return Participation(
        spans=across / total[:, None],
        pulleys=turns / total[:, None],
        mounts=moved / total[:, None],
        belt=belt / total,
    )


def moves(linear: Linear, vectors: Complex, rates: Any) -> tuple[Complex, Complex]:
    """Return displacements in x and y of links, or of the belt where cells begin (n_b, n) [m].

    Belt that flows moves by its velocity over the rate [1/s] along itself, as if at rest, and with
    the axes of the pulleys across.
    """
    params = linear.params
    if not params._flows:
        return linear.field(vectors, "x"), linear.field(vectors, "y")
    seen, cells = params._model.observe(linear.state), params._cells
    centers = params.centers(linear.state["travel"])
    on = np.where(cells < 0, np.roll(cells, 1), cells)  # a span begins where a wrap ends
    arm = np.column_stack([seen["x"][0], seen["y"][0]]) - centers[on]
    arm /= np.hypot(*arm.T)[:, None]
    along = params.route.senses[on, None] * np.column_stack([-arm[:, 1], arm[:, 0]])
    move = np.asarray(along[..., None] * (linear.field(vectors, "v") / rates)[:, None])
    travel = linear.field(vectors, "travel")
    for m, k, mount in params._moving:
        across = arm * (arm @ mount._direction(centers[k]))[:, None]
        move += np.where((on == k)[:, None], across, 0.0)[..., None] * travel[m]
    return move[:, 0], move[:, 1]


def weighted(linear: Linear, vectors: Complex) -> Complex:
    """Speeds in modes times roots of their inertias (m, n), of which squares are energies."""
    return np.concatenate(
        [np.sqrt(m)[:, None] * linear.field(vectors, name) for name, m in linear.masses.items()]
    )


def steady_share(linear: Linear, vectors: Complex) -> Array:
    """Share of the energy (n,) that is in the mean over the phases of the mesh; 1 of one phase."""
    if len(linear.parts) == 1:
        return np.ones(vectors.shape[1])
    each = [(part, vectors[linear.phase == k]) for k, part in enumerate(linear.parts)]
    mean, *energies = (
        np.sum(abs(weighted(*one)) ** 2, axis=0) for one in [(linear, vectors), *each]
    )
    return np.asarray(mean / np.mean(energies, axis=0))


def same_modes(own: Complex, others: Complex) -> tuple[NDArray[np.intp], Array]:
    """Return the other mode that each own one corresponds to (n,), and their likeness to 1 (n,).

    Alike are those of which the modal assurance criterion, by energies, has the largest sum.
    """
    product = abs(own.conj().T @ others) ** 2
    product /= np.sum(abs(own) ** 2, axis=0)[:, None] * np.sum(abs(others) ** 2, axis=0)
    which = import_module("scipy.optimize").linear_sum_assignment(product, maximize=True)[1]
    return which, product[np.arange(len(which)), which]


def names(linear: Linear, vectors: Complex) -> tuple[str, ...]:
    """Describe in words what moves most in each mode."""
    return tuple(_name(linear, vectors[:, [k]]) for k in range(vectors.shape[1]))


def _name(linear: Linear, vector: Complex) -> str:
    params, shares = linear.params, participation(linear, vector)
    parts: list[tuple[float, str]] = [(float(shares.belt[0]), "belt along itself")]
    for span, share in enumerate(shares.spans[0]):
        if share > SECOND / len(params.pulleys):
            name = f"span {span_names(params.pulley_names)[span]}"
            parts.append((float(share), f"{name}, {_order(linear, vector, span)} lateral"))
    parts.append((float(shares.pulleys.sum()), _rotation(linear, vector, shares.pulleys[0])))
    for m, share in enumerate(shares.mounts[0]):
        row, pulley = mount_kinds(params)[m], params.mounted[m]
        parts.append((float(share), f"{row.part} of {params.pulley_names[pulley]}"))
    parts.sort(key=lambda part: -part[0])
    name = parts[0][1]
    return name if parts[1][0] < SECOND else f"{name}; with {parts[1][1]}"


def _order(linear: Linear, vector: Complex, span: int) -> str:
    """Name the order of the shape of a span, as 1st."""
    if linear.params._flows:
        shape = linear.field(vector, "a")[:, 0].reshape(len(linear.ways), -1)[span]
        order = 1 + int(np.argmax(abs(shape)))
    else:
        inside, way = linear.spans == span, linear.ways[span]
        # round the ring from the first link that is free behind one that is not
        first = int(np.flatnonzero(inside & ~np.roll(inside, 1))[0])
        free = (first + np.flatnonzero(np.roll(inside, -first))) % inside.size
        x, y = (linear.field(vector, name)[free, 0] for name in ("x", "y"))
        across = way[0] * y - way[1] * x
        real = (across * np.exp(-0.5j * np.angle(np.sum(across**2)))).real
        real = real[abs(real) > NODE * abs(real).max()]
        order = 1 + int(np.count_nonzero(np.diff(np.sign(real))))
    return _ORDINALS.get(order, f"{order}th")


def _rotation(linear: Linear, vector: Complex, shares: Array) -> str:
    """Name what turns most, of pulleys and both parts of coupled ones, and against what."""
    # The energy of a coupled pulley is that of both parts; it goes to each by its inertia.
    params, names = linear.params, [*linear.params.pulley_names]
    coupled, radii = list(params.coupled), params._rolling
    shaft, other = (linear.field(vector, name)[:, 0] for name in ("omega", "rim_speed"))
    of_shaft = params.shaft_inertias[coupled] * abs(shaft[coupled]) ** 2
    of_other = params.coupled_inertias * abs(other) ** 2
    part = of_other / np.maximum(of_shaft + of_other, 1e-300)
    for k in coupled:
        coupling = params.pulleys[k].coupling
        kind = "rim" if coupling is None else coupling._part
        names.append(f"{kind} of {names[k]}")
        names[k] = f"hub of {names[k]}" if kind == "rim" else names[k]
    share = np.concatenate([shares, shares[coupled] * part])
    share[coupled] *= 1.0 - part
    move = np.concatenate([radii * shaft, radii[coupled] * other])
    most = int(np.argmax(share))
    against = ""
    opposite = (move * np.conj(move[most])).real < 0.0
    if opposite.any():
        second = int(np.argmax(np.where(opposite, share, -1.0)))
        if share[second] > 0.01 * share[most]:
            against = names[second]
    elif linear.prescribed:
        against = params.pulley_names[linear.prescribed[0]]
    return f"rotation of {names[most]}" + (f" against {against}" if against else "")
