"""Reference curves of the paper's cases: made by two integrators that share nothing, and kept.

    python tests/reference_curves.py [--case 1] [--quick] [--show] [--tol 1e-9] [--out DIR]

From one settled state, A is beltdyn's "tsit5" at a tolerance near its limit and B is SciPy's
DOP853 on the NumPy oracle (`reference.py`, written from the equations alone), which is fast enough
for the whole run. Their difference is the floor: nothing can be shown to be nearer to the truth.

A stick-slip drive may make more of a small difference by itself: B over the whole run tells how far
the curves can be known at all; B begun anew from A's state at every leg, a tenth of the run, how
well the equations are solved; the growth of a leg what a small change of its start comes to in it.

A file of `tests/curves/` holds A's curves, the difference B - A of the legs, the state at the
start of every leg, the scene as TOML and the hash of the oracle, so that a scene or an oracle that
has changed since is noticed. Runs of the oracle alone are in `stored_runs.py`.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import attrs
import numpy as np
import stored_runs
from beltdyn_kubas import LINKS
from bridge import fields, oracle_of
from numpy.typing import NDArray

import beltdyn as bd

Array = NDArray[np.float64]
Floor = dict[str, tuple[float, float]]

CASES: dict[str, Callable[[], bd.Scene]] = {
    "1": bd.scenes.kubas_case_1,
    "2": bd.scenes.kubas_case_2,
    "2-5e3": partial(bd.scenes.kubas_case_2, sigma=5e3),
}
DIRECTORY = Path(__file__).resolve().parent / "curves"

#: Tolerances of A and B. Below 1e-11 rounding in the stretch of the joints, 1e-16 m of positions
#: over 1e-4 m, takes over from the error of a step.
RTOL = 1e-11
TOL = 1e-9
LEGS = 10
#: The part of a leg that the tests make anew, and the run of --quick [s].
FIRST = 0.005
QUICK = 0.05
#: Part of the joints' mean stretch by which the start of a leg is changed to see its growth.
NUDGE = 1e-6
#: No sample is this near to a kept link's touching or leaving a pulley [s]: the normal force jumps
#: there by the damper's b v, and a method that is late by one step would seem to be all wrong.
CLEAR = 5e-5

QUANTITIES = ("omega", "force", "mu", "normal")


@attrs.frozen(eq=False, kw_only=True)
class Curves:
    """What a file holds.

    Curves are pulley speeds [rad/s], then joint forces [N], mu [1] and normal forces [N] of links.
    """

    scene: str  # as TOML
    oracle: str  # hash of its source
    edges: Array  # ends of the legs (n_w + 1,) [s]
    states: dict[str, Array]  # A's at the start of each leg, by field
    t: Array  # samples [s], irregular
    links: NDArray[np.int64]  # two that may be the paper's, two a third of the belt apart
    a: Array  # curves of A (n_t, n_c)
    b: Array  # the same of B begun anew from A's state in every leg
    tension: float  # mean joint force of the run [N], the scale of forces
    run_floor: Array  # largest difference over its scale of A and B in one run (n_w, 4)
    growth: Array  # of a small change of all links at random, in joint forces, by leg
    rtol: float  # of A
    tol: float  # of B
    seconds: Array  # CPU time of A, and of B once through the run

    def state(self, leg: int) -> bd.State:
        """A's state at the start of a leg."""
        arrays: dict[str, Any] = {name: values[leg] for name, values in self.states.items()}
        return bd.State(**arrays, t=float(self.edges[leg]))

    def legs(self) -> Iterator[tuple[int, slice]]:
        """Yield each leg with its samples, those after its start; the first has them all."""
        ends = np.searchsorted(self.t, self.edges, side="right")
        ends[0] = 0
        for leg in range(len(self.edges) - 1):
            yield leg, slice(int(ends[leg]), int(ends[leg + 1]))

    def columns(self) -> dict[str, slice]:
        """Columns of ``a`` and ``b`` by quantity."""
        n_l = len(self.links)
        n_p = self.a.shape[1] - 3 * n_l
        ends = [0, n_p, n_p + n_l, n_p + 2 * n_l, n_p + 3 * n_l]
        return {name: slice(*ends[k : k + 2]) for k, name in enumerate(QUANTITIES)}

    def scales(self) -> dict[str, float]:
        """What differences are relative to: the largest speed, the mean tension, and 1 for mu."""
        speed = float(np.max(np.abs(self.a[:, self.columns()["omega"]])))
        return {"omega": speed, "force": self.tension, "mu": 1.0, "normal": self.tension}

    def errors(self, got: Array, samples: slice = slice(None)) -> dict[str, Array]:
        """Difference from A over its scale, by quantity, for some of the samples."""
        return {
            name: (got - self.a[samples])[:, columns] / self.scales()[name]
            for name, columns in self.columns().items()
        }

    def floor(self, samples: slice = slice(None)) -> Floor:
        """Largest and root mean square difference of A and B over their scale, by quantity."""
        return {
            name: (float(np.max(np.abs(error))), float(np.sqrt(np.mean(error**2))))
            for name, error in self.errors(self.b[samples], samples).items()
        }

    def __str__(self) -> str:
        lines = [
            f"links {self.links.tolist()}, {len(self.t)} samples to {self.t[-1]:g} s, mean tension "
            f"{self.tension:.5g} N",
            f"A: tsit5, rtol {self.rtol:g}, {self.seconds[0]:.1f} s CPU; "
            f"B: DOP853 on the oracle, tol {self.tol:g}, {self.seconds[1]:.1f} s CPU",
            f"  {'leg [s]':13}"
            + "".join(f"{name + ' max':>12}{'rms':>9}" for name in QUANTITIES)
            + f"{'growth':>9}   whole run:"
            + "".join(f"{name:>9}" for name in QUANTITIES),
        ]
        for leg, samples in self.legs():
            lines.append(
                f"  {self.edges[leg]:<5.3g} - {self.edges[leg + 1]:<5.3g}"
                + "".join(f"{top:12.1e}{rms:9.1e}" for top, rms in self.floor(samples).values())
                + f"{self.growth[leg]:9.2g}{'':13}"
                + "".join(f"{top:9.1e}" for top in self.run_floor[leg])
            )
        return "\n".join(lines)

    def write(self, path: Path) -> None:
        """Write a compressed file; B as its difference, to which single precision does no harm."""
        values = {field.name: getattr(self, field.name) for field in attrs.fields(Curves)}
        del values["states"], values["b"]
        values |= {f"states.{name}": value for name, value in self.states.items()}
        values["difference"] = (self.b - self.a).astype(np.float32)
        stored_runs.write(path, values)

    @classmethod
    def read(cls, path: Path) -> Curves:
        """Read what :meth:`write` wrote."""
        with np.load(path, allow_pickle=False) as file:
            values = {name: value if value.ndim else value.item() for name, value in file.items()}
        names = [name for name in values if name.startswith("states.")]
        values["states"] = {name.removeprefix("states."): values.pop(name) for name in names}
        values["b"] = values["a"] + values.pop("difference")
        return cls(**values)


def path_of(case: str, directory: Path = DIRECTORY) -> Path:
    return directory / f"case-{case}.npz"


def sample_times(edges: Array) -> Array:
    """In every leg 4 samples in its first milliseconds, then 28 at golden-ratio places: in step
    with nothing. Also the start and the end of the run.
    """
    golden = (np.arange(28) * 0.5 * (np.sqrt(5.0) - 1.0)) % 1.0
    share = (np.arange(28) + 0.1 + 0.8 * golden) / 28
    legs = []
    for begin, end in pairwise(edges):
        early = min(FIRST, 0.5 * (end - begin))
        legs += [begin + early * np.arange(1, 5) / 4, begin + early + share * (end - begin - early)]
    return np.concatenate([edges[:1], *legs, edges[-1:]])


def chosen_links(case: str, n_b: int) -> NDArray[np.int64]:
    """The paper's chosen element, the next one, and links a third of the belt further on."""
    first = LINKS[int(case[0]) - 1]
    return np.array([first, first + 1, *((first + 1 + n_b * np.arange(1, 3) // 3) % n_b)])


def clear_times(scene: bd.Scene, start: bd.State, times: Array, links: NDArray[np.int64]) -> Array:
    """Those of the times that are not near to a kept link's touching or leaving a pulley."""
    around = np.clip(times + CLEAR * np.array([[-1.0], [0.0], [1.0]]), times[0], times[-1])
    order = np.argsort(around, axis=None)
    result = bd.simulate(
        *scene[:2], times[-1], initial=start, t_eval=around.ravel()[order], rtol=1e-9
    )
    touched = np.empty((around.size, len(links)), dtype=int)
    touched[order] = result.contact.pulley[:, links]
    touched = touched.reshape(*around.shape, len(links))
    clear: NDArray[np.bool_] = (touched == touched[0]).all(axis=(0, 2))
    return times[clear]


def run_core(
    scene: bd.Scene, start: bd.State, times: Array, end: float, rtol: float = RTOL
) -> bd.Result:
    return bd.simulate(
        *scene[:2], end, initial=start, t_eval=times, method="tsit5", rtol=rtol, ledger=False
    )


def pick(result: bd.Result, links: NDArray[np.int64]) -> Array:
    """Columns of a run: pulley speeds, then joint force, mu, normal force of the links."""
    contact = result.contact
    return np.hstack(
        [
            result.pulleys.omega,
            result.joints.force[:, links],
            contact.mu[:, links],
            contact.normal[:, links],
        ]
    )


def run_oracle(
    scene: bd.Scene, start: bd.State, times: Array, links: NDArray[np.int64], tol: float = TOL
) -> Array:
    """Return the same columns by SciPy's DOP853 on the oracle."""
    model, torque = oracle_of(scene.params), scene.torque_fn
    assert isinstance(torque, bd.Torque)
    case = stored_runs.Case(
        oracle=model, torque=torque, start=lambda: start, after=times - start.t, tol=tol
    )
    y = case.integrate(fields(start)).y
    return np.hstack(
        [
            model.pulleys(y)[:, 1],
            model.joints(y)[1][:, links],
            model.memory(y)[:, 0].sum(axis=1)[:, links],
            model.contacts(y).normal.sum(axis=1)[:, links],
        ]
    )


def nudged(scene: bd.Scene, start: bd.State) -> bd.State:
    """Move every link at random by NUDGE of a joint's mean stretch."""
    info = scene.params.info
    size = NUDGE * info["strain"] * info["link_length"]
    shift = size * np.random.default_rng(1).uniform(-1.0, 1.0, (2, start.n_bodies))
    return attrs.evolve(start, x=start.x + shift[0], y=start.y + shift[1])


def growth_of(scene: bd.Scene, start: bd.State, end: float) -> float:
    times = np.linspace(start.t, end, 201)
    ways = [run_core(scene, state, times, end) for state in (start, nudged(scene, start))]
    change = np.max(np.abs(ways[1].joints.force - ways[0].joints.force), axis=1)
    return float(np.max(change) / change[0])


def make(case: str, t_end: float | None = None, tol: float = TOL) -> Curves:
    """Make the curves of a case by both integrators, over the whole run or up to a time [s]."""
    scene = CASES[case]()
    start = bd.settle(scene.params)
    links = chosen_links(case, scene.params.belt.n_bodies)
    end = scene.t_end if t_end is None else t_end
    # Rounded: a leg must begin on a kink of the torque or clear of it, not 1e-17 s before.
    edges = np.round(np.linspace(0.0, end, LEGS + 1), 12)
    times = clear_times(scene, start, sample_times(edges), links)

    states, parts, forces = [start], [], []
    begun = time.process_time()
    # Begun anew in every leg as well, so that a leg follows from its state to the last bit.
    ends = np.searchsorted(times, edges, side="right")
    ends[0] = 0
    for leg in range(LEGS):
        samples = times[ends[leg] : ends[leg + 1]]
        result = run_core(scene, states[leg], samples, edges[leg + 1])
        parts.append(pick(result, links))
        forces.append(result.joints.force)
        states.append(result.final_state)
    seconds_a = time.process_time() - begun
    begun = time.process_time()
    whole = run_oracle(scene, start, times, links, tol)
    seconds_b = time.process_time() - begun

    kept = [fields(state) for state in states[:LEGS]]
    curves = Curves(
        scene=scene.to_toml(),
        oracle=stored_runs.hash_of_oracle(),
        edges=edges,
        states={name: np.array([state[name] for state in kept]) for name in kept[0] if name != "t"},
        t=times,
        links=links,
        a=np.vstack(parts),
        b=whole,
        tension=float(np.mean(np.vstack(forces))),
        run_floor=np.empty(0),
        growth=np.array([growth_of(scene, states[k], edges[k + 1]) for k in range(LEGS)]),
        rtol=RTOL,
        tol=tol,
        seconds=np.array([seconds_a, seconds_b]),
    )
    # So far b is the whole run.
    run_floor = [[top for top, _ in curves.floor(s).values()] for _, s in curves.legs()]
    legs = [
        run_oracle(scene, curves.state(leg), times[samples], links, tol)
        for leg, samples in curves.legs()
    ]
    return attrs.evolve(curves, b=np.vstack(legs), run_floor=np.array(run_floor))


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--case", choices=CASES, action="append", help="one case; default: all")
    parser.add_argument(
        "--quick", action="store_true", help=f"the first {QUICK:g} s only, nothing written"
    )
    parser.add_argument("--show", action="store_true", help="print what the files hold, run none")
    parser.add_argument("--tol", type=float, default=TOL, help="tolerance of the oracle's run")
    parser.add_argument("--out", type=Path, default=DIRECTORY, help="directory of the files")
    arguments = parser.parse_args()
    for case in arguments.case or CASES:
        path = path_of(case, arguments.out)
        if arguments.show:
            curves = Curves.read(path)
        else:
            curves = make(case, QUICK if arguments.quick else None, arguments.tol)
            if not arguments.quick:
                curves.write(path)
        print(f"case {case}: {curves}", flush=True)


if __name__ == "__main__":
    main()
