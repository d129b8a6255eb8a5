"""General integrators on the same drive: SciPy and SUNDIALS against this package, in one run.

    python benchmarks/peers.py [--quick] [--write]

The drive is the paper's case 1, from 0.3 to 0.4 s: the torque's ramp is over, friction has
developed, links arrive at and leave both pulleys, and links that stick creep. All solvers integrate
this window, from the same state, with the same irregular sample times. A whole second would favour
none of them but take the slowest an hour.

Peers: SciPy's `solve_ivp` with a plain NumPy model (`numpy_model.py`) and with a compiled one
(`numba_model.py`), and SUNDIALS CVODE through scikit-sundae with the compiled one. The compiled
model comes with its analytic Jacobian, sparse and, links renumbered, banded; NumPy's comes by
grouped differences. Where a solver has a choice of linear solvers, all are tried at one tolerance
and the cheapest is used for the others. Tolerances are absolute, on the scale that matters for
joint forces, a joint's stretch: relative to coordinates they would be a thousand times too loose.
BLAS is held to one thread. Models are checked first: against the oracle of the tests, which knows
neither, and the Jacobian against differences (`peers_check.py`).

A peer cannot reset mu when a link leaves its pulley; its model lets mu decay there. So peers have a
reference of their own, on which two of them agree, and the report gives its distance from the
package's.
All times here are process CPU seconds round the whole call, Python's part and samples included; the
package carries its energy ledger along, as it does by default, the peers none.
"""

from __future__ import annotations

import os
import sys
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from itertools import pairwise
from typing import Any

import common
import numba_model
import numpy as np
import numpy_model
import peers_check
import scipy.integrate
import scipy.sparse
from numba_model import BAND, Compiled
from numpy_model import FIELDS, Drive
from sksundae.cvode import CVODE

import beltdyn as bd

THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
TARGETS = (2e-2, 5e-3, 1e-3, 1e-4, 1e-5, 1e-6)
TOLERANCES = (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5, 1e-6, 1e-7)
SURVEY = 1e-3  # the tolerance at which a peer's options are compared
#: Knots of a torque up to which solvers are begun anew at each.
PIECES = 20
RELATIVE = 2.3e-14  # the least SciPy takes: weights are absolute

#: (tolerance, end of the window) -> states at the start and at the sample times before that end
Solve = Callable[[float, float], np.ndarray]


@dataclass(frozen=True)
class Peer:
    """A method of a library on one of the models, with the options it leaves to its user."""

    name: str
    options: dict[str, Solve]


class Problem:
    """The case as the peers see it: state vectors, weights, sample times."""

    def __init__(self, case: common.Case, scene: bd.Scene) -> None:
        self.drive = Drive.of(scene)
        self.t0, self.t1 = case.start.t, case.t_end
        self.times = np.concatenate([[self.t0], case.times])
        self.y0 = self.drive.pack(case.start)
        force = numpy_model.joint_force(self.drive, self.y0[None])
        stretch = float(np.mean(force)) / self.drive.c_tra
        half = self.drive.half
        scale = {"x": stretch, "y": stretch, "phi": stretch / half, "vx": 0.1, "vy": 0.1,
                 "vphi": 0.1 / half, "mu": 1.0, "theta": 1e-3, "omega": 1.0}  # fmt: skip
        self.weights = self.drive.per_variable(scale)
        self.plain = numpy_model.make_rhs(self.drive)
        self.natural = numba_model.compiled(self.drive)
        self.folded = numba_model.compiled(self.drive, fold=True)
        self.unfold = np.argsort(self.folded.order)

        for model in (self.natural, self.folded):
            y = self.y0[model.order]
            for state in (y, y.view()):
                state.flags.writeable = state is y  # CVODE's are read-only: another compilation
                model.rhs(self.t0, state)
                model.rhs_into(self.t0, state, np.empty_like(y))
                model.jacobian(self.t0, state)

    def until(self, end: float) -> np.ndarray:
        return np.append(self.times[self.times < end], end)

    def scipy(self, method: str, rhs: Any, order: np.ndarray, **options: Any) -> Solve:
        weights = self.weights[order]

        def solve(tolerance: float, end: float) -> np.ndarray:
            def piece(times: np.ndarray, y: np.ndarray) -> np.ndarray:
                before = np.nextafter(times[-1], times[0])
                found = scipy.integrate.solve_ivp(
                    lambda t, y: rhs(min(t, before), y),
                    (times[0], times[-1]),
                    y,
                    method=method,
                    t_eval=times,
                    rtol=RELATIVE,
                    atol=tolerance * weights,
                    **options,
                )
                if not found.success:
                    raise RuntimeError(found.message)
                return np.asarray(found.y.T)

            # SciPy's own differences try ever larger steps where nothing changes, as in theta.
            with np.errstate(over="ignore", invalid="ignore"):
                return self._in_pieces(piece, end, order)

        return solve

    def cvode(self, method: str, order: int, model: Compiled, **options: Any) -> Solve:
        weights = self.weights[model.order]

        def solve(tolerance: float, end: float) -> np.ndarray:
            def piece(times: np.ndarray, y: np.ndarray) -> np.ndarray:
                before = np.nextafter(times[-1], times[0])

                def rhs(t: float, y: np.ndarray, dy: np.ndarray) -> None:
                    model.rhs_into(min(t, before), y, dy)

                solver = CVODE(
                    rhs,
                    method=method,
                    max_order=order,
                    rtol=1e-15,
                    atol=tolerance * weights,
                    max_num_steps=10**8,
                    **options,
                )
                found = solver.solve(times, y)
                if not found.success:
                    raise RuntimeError(found.message)
                # Of two times alone it gives every step.
                return np.asarray(found.y if times.size > 2 else found.y[[0, -1]])

            with warnings.catch_warnings():
                # That a pattern's own differences go unused where there is a Jacobian.
                warnings.simplefilter("ignore")
                return self._in_pieces(piece, end, model.order)

        return solve

    def _in_pieces(self, piece: Any, end: float, order: np.ndarray) -> np.ndarray:
        """States in NumPy's order; begun anew where the torque jumps or bends, if that is seldom.

        A solver does not see a torque that comes and goes within a step, and its user knows when.
        """
        knots = np.unique(self.drive.knots)
        knots = knots[(knots > self.t0) & (knots < end)]
        edges = [self.t0, *(knots if len(knots) <= PIECES else ()), end]
        y, found = self.y0[order], [self.y0[order][None]]
        for begin, stop in pairwise(edges):
            inside = self.times[(self.times > begin) & (self.times < stop)]
            states = piece(np.array([begin, *inside, stop]), y)
            y = states[-1].copy()  # contiguous: another layout would be compiled anew
            found.append(states[1:-1])
        states = np.vstack([*found, y])
        natural = np.empty_like(states)
        natural[:, order] = states
        return natural

    def force(self, states: np.ndarray) -> np.ndarray:
        """Joint forces at the sample times: all states but those of start and end."""
        return numpy_model.joint_force(self.drive, states[1:-1])

    # ------------------------------------------------------------ who takes part

    def peers(self) -> list[Peer]:
        natural, folded = self.natural, self.folded
        found = []
        for model in ("NumPy", "Numba"):
            plain = model == "NumPy"
            rhs = self.plain if plain else natural.rhs
            order = np.arange(self.y0.size) if plain else natural.order
            for method in ("RK23", "RK45", "DOP853"):
                found.append(Peer(f"SciPy {method}, {model}", {"": self.scipy(method, rhs, order)}))
            sparse = self.differences if plain else natural.jacobian
            banded = {
                "rhs": self.folded_plain if plain else folded.rhs,
                "order": folded.order,
                "jac": self.packed_differences() if plain else folded.packed,
            }
            found.append(
                Peer(
                    f"SciPy LSODA, {model}",
                    {
                        "banded": self.scipy("LSODA", **banded, lband=BAND, uband=BAND),
                        "dense": self.scipy("LSODA", rhs, order, jac=dense(sparse)),
                        "its own differences": self.scipy("LSODA", rhs, order),
                    },
                )
            )
            for method in ("BDF", "Radau"):
                options = {
                    "sparse": self.scipy(method, rhs, order, jac=sparse),
                    "dense": self.scipy(method, rhs, order, jac=dense(sparse)),
                    "its own differences": self.scipy(method, rhs, order),
                }
                found.append(Peer(f"SciPy {method}, {model}", options))
        for method, order in (("BDF", 2), ("BDF", 5), ("Adams", 12)):
            options = {
                "band": self.cvode(method, order, folded, linsolver="band", lband=BAND,
                                   uband=BAND, jacfn=filled(folded)),
                "sparse": self.cvode(method, order, natural, linsolver="sparse",
                                     sparsity=natural.pattern, jacfn=natural_data(natural)),
                "lapackdense": self.cvode(method, order, natural, linsolver="lapackdense",
                                          jacfn=filled(natural)),
                "gmres 5": self.cvode(method, order, natural, linsolver="gmres", krylov_dim=5),
                "gmres 30": self.cvode(method, order, natural, linsolver="gmres", krylov_dim=30),
            }  # fmt: skip
            found.append(Peer(f"CVODE {method} to order {order}, Numba", options))
        return found

    # ------------------------------------------------------------ NumPy's Jacobian

    def differences(self, t: float, y: np.ndarray) -> scipy.sparse.csc_matrix:
        """The Jacobian by grouped differences, one evaluation a group.

        What a link does to a pulley is left out: all links do, and nothing could be grouped. For
        Newton's iteration that is near enough.
        """
        (row, column, group), data = self.groups, np.empty(self.groups[0].size)
        step = 1e-6 * self.weights
        f0 = self.plain(t, y)
        for k in range(group.max() + 1):
            inside = group[column] == k
            change = self.plain(t, y + np.where(group == k, step, 0.0)) - f0
            data[inside] = change[row[inside]] / step[column[inside]]
        return scipy.sparse.csc_matrix((data, (row, column)), (y.size, y.size))

    @cached_property
    def groups(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rows and columns of the Jacobian's entries, the group of every column.

        Links three apart share no neighbour; each omega is a group; theta changes nothing here.
        """
        n, n_p, links = self.drive.n, self.drive.n_p, len(FIELDS) * self.drive.n
        if n % 3:
            raise ValueError("the groups are for a number of links divisible by three")
        pattern = self.natural.pattern.tocoo()
        row, column = self.natural.order[pattern.row], self.natural.order[pattern.col]
        kept = (row < links) | (column >= links)
        group = np.concatenate(
            [
                (3 * np.arange(len(FIELDS))[:, None] + np.arange(n) % 3).ravel(),
                np.full(n_p, -1),
                3 * len(FIELDS) + np.arange(n_p),
            ]
        )
        kept &= group[column] >= 0
        return row[kept], column[kept], group

    def folded_plain(self, t: float, z: np.ndarray) -> np.ndarray:
        """NumPy's right-hand side in the order that makes the Jacobian banded."""
        return self.plain(t, z[self.unfold])[self.folded.order]

    def packed_differences(self) -> Any:
        def jacobian(t: float, z: np.ndarray) -> np.ndarray:
            entries = self.differences(t, z[self.unfold]).tocoo()
            row, column = self.unfold[entries.row], self.unfold[entries.col]
            within = np.abs(row - column) <= BAND
            matrix = np.zeros((2 * BAND + 1, z.size))
            matrix[(row - column + BAND)[within], column[within]] = entries.data[within]
            return matrix

        return jacobian


def dense(jacobian: Any) -> Any:
    return lambda t, y: jacobian(t, y).toarray()


def natural_data(model: Compiled) -> Any:
    def fill(t: float, y: np.ndarray, _dy: np.ndarray, data: np.ndarray) -> None:
        model.data_into(t, y, data)

    return fill


def filled(model: Compiled) -> Any:
    """CVODE's dense and band solvers both want a full matrix to be filled."""
    data, pattern = np.empty(model.pattern.nnz), model.pattern.tocoo()

    def fill(t: float, y: np.ndarray, _dy: np.ndarray, matrix: np.ndarray) -> None:
        model.data_into(t, y, data)
        matrix[pattern.row, pattern.col] = data

    return fill


def clocked(function: Callable[[], Any]) -> tuple[float, Any]:
    begin = time.process_time()
    result = function()
    return time.process_time() - begin, result


# ---------------------------------------------------------------- measuring


def survey(problem: Problem, exact: np.ndarray, end: float) -> tuple[dict[str, Solve], list[str]]:
    """Each peer's cheapest option at one tolerance; what the others cost."""
    best: dict[str, Solve] = {}
    lines = []
    inside = np.count_nonzero(problem.until(end)[1:-1] < end)
    for peer in problem.peers():
        common.progress(f"options of {peer.name}")
        costs: dict[str, float] = {}
        for option, solve in peer.options.items():
            if len(peer.options) == 1:
                costs[option] = 0.0
                continue
            try:
                costs[option], states = clocked(lambda solve=solve: solve(SURVEY, end))
            except RuntimeError as failure:
                lines.append(f"  {peer.name}, {option}: fails, {failure}")
                continue
            error = common.rms_error(problem.force(states), exact[:inside])
            lines.append(
                f"  {peer.name + ', ' + option:48s} {costs[option] / (end - problem.t0):9.3f}"
                f" {error:9.1e}"
            )
        option = min(costs, key=lambda name: costs[name])
        name = f"{peer.name}, {option}" if option else peer.name
        best[name] = peer.options[option]
    return best, lines


def compare(
    rows: Sequence[common.Row], ours: Sequence[common.Row], names: Sequence[str], duration: float
) -> list[str]:
    """Cheapest setting of everyone for each error, and its ratio to ours."""
    lines = [
        "CPU seconds per simulated second of the cheapest setting that reaches an error,"
        " and times that of the package's best",
        " " * 44 + "".join(f"{f'<= {target:.0e}':>18s}" for target in TARGETS),
    ]
    best = {target: common.cheapest(ours, target) for target in TARGETS}
    cells = [f"{b.seconds / duration:.4f}        " if b else "-        " for b in best.values()]
    lines.append(f"{'beltdyn, best':44s}" + "".join(f"{cell:>18s}" for cell in cells))
    chosen = [f"{b.name} {b.value:.0e}" if b else "-" for b in best.values()]
    lines.append(f"{'':44s}" + "".join(f"{cell:>18s}" for cell in chosen))
    for name in names:
        text = f"{name:44s}"
        for target in TARGETS:
            row = common.cheapest((row for row in rows if row.name == name), target)
            mine = best[target]
            cell = "-"
            if row is not None:
                cell = f"{row.seconds / duration:.3f}"
                cell += f" x {row.seconds / mine.seconds:<5.3g}" if mine else ""
            text += f"{cell:>18s}"
        lines.append(text)
    return lines


def draw(
    case: common.Case, rows: Sequence[common.Row], ours: Sequence[common.Row], floor: float
) -> Any:
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(11, 7), layout="constrained")
    for group, width in ((rows, 1.0), (ours, 2.4)):
        styles = common.colours([row.name for row in group])
        shades = mpl.colormaps["inferno"](np.linspace(0.0, 0.75, len(styles)))
        for shade, (name, (colour, marker)) in zip(shades, styles.items(), strict=True):
            points = [row for row in group if row.name == name]
            dashed = "NumPy" in name
            axes.plot(
                [row.error for row in points],
                [row.seconds / case.duration for row in points],
                ":" if dashed else "-",
                marker=marker,
                color=shade if group is ours else colour,
                mfc="w" if dashed else None,
                lw=width,
                ms=5,
                label=("beltdyn " if group is ours else "") + name,
            )
    axes.set(xscale="log", yscale="log", xlim=(1e-7, 0.3),
             xlabel="error of joint forces, rms over mean tension",
             ylabel="CPU seconds per simulated second",
             title=f"case 1, {case.start.t:g} to {case.t_end:g} s")  # fmt: skip
    axes.axvspan(1e-7, max(floor, 1e-7), color="0.88", zorder=0)
    axes.grid(alpha=0.25)
    axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def main() -> None:
    arguments = common.arguments(__doc__, "12 minutes", "20 s")
    quick = arguments.quick
    scene = bd.scenes.kubas_case_1()
    case = common.case("case 1", scene, 0.3, 0.302 if quick else 0.4)
    tolerances = TOLERANCES[2:-1:2] if quick else TOLERANCES
    effort: dict[str, Any] = (
        {"repeats": 1, "limit": 1.0, "budget": 1.0}
        if quick
        else {"repeats": 5, "limit": 30.0, "budget": 6.0}
    )
    problem = Problem(case, scene)
    lines = [
        f"Peers: case 1, n_b = {case.params.belt.n_bodies}, {case.start.t:g} to {case.t_end:g} s",
        *common.machine(),
        "; ".join(f"{name} {version(name)}" for name in ("scipy", "numba", "scikit-sundae")),
        f"medians of up to {effort['repeats']} interleaved repeats; mu decays at "
        f"{numpy_model.DECAY:g} 1/s off the pulleys in the peers' model",
        peers_check.check(problem, case),
    ]

    mine = common.reference(case)
    tight = {
        "SciPy DOP853 1e-10": problem.scipy("DOP853", problem.natural.rhs, problem.natural.order)(
            1e-10, case.t_end
        ),
        "CVODE Adams 1e-9": problem.cvode(
            "Adams", 12, problem.folded, linsolver="band", lband=BAND, uband=BAND,
            jacfn=filled(problem.folded),
        )(1e-9, case.t_end),
    }  # fmt: skip
    exact, check = (problem.force(states) for states in tight.values())
    floor = common.rms_error(check, exact)
    lines += [
        f"the package's {mine.text}",
        f"the peers' reference by {' and '.join(tight)}, apart by {floor:.1e} (their floor); "
        f"from the package's by {common.rms_error(exact, mine.force):.1e}",
        "",
        f"options at a tolerance of {SURVEY:g}: CPU s per s, error",
    ]
    best, surveyed = survey(problem, exact, min(case.t_end, case.start.t + 0.02))
    lines += surveyed
    common.progress("climbing the ladders")

    def peer_run(solve: Solve, tolerance: float) -> common.Run:
        return lambda: clocked(lambda: solve(tolerance, case.t_end))

    def our_run(options: dict[str, Any]) -> common.Run:
        return lambda: clocked(lambda: case.run(**options))

    runs = [(name, [(x, peer_run(solve, x)) for x in tolerances]) for name, solve in best.items()]
    for ladder in common.LADDERS:
        settings = [ladder.options(value, case.params) for value in ladder.values]
        runs.append((ladder.name, [(x[ladder.option], our_run(x)) for x in settings]))

    def error(result: Any) -> float:
        if isinstance(result, bd.Result):
            return mine.error(result)
        return common.rms_error(problem.force(result), exact)

    every, failed = common.climb(runs, error, failures=(bd.SimulationError, RuntimeError), **effort)
    rows = [row for row in every if row.name in best]
    ours = [row for row in every if row.name not in best]
    table = [
        "",
        "integrator, model, linear algebra              tolerance  CPU s per s  repeats  error rms",
    ]
    for row in every:
        table.append(
            f"{('' if row.name in best else 'beltdyn ') + row.name:46s} {row.value:9.1e}"
            f" {row.seconds / case.duration:12.4f} {len(row.cpu):8d} {row.error:10.1e}"
        )
    table += [*failed, "", *compare(rows, ours, list(best), case.duration)]
    common.publish(
        "peers",
        lines + table,
        arguments.write,
        draw(case, rows, ours, max(floor, mine.floor)),
    )


if __name__ == "__main__":
    if any(os.environ.get(name) != "1" for name in THREADS):  # read when BLAS is loaded
        one = os.environ | dict.fromkeys(THREADS, "1")
        os.execve(sys.executable, [sys.executable, *sys.argv], one)
    main()
