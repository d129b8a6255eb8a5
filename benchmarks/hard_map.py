"""Which fixed steps are stable, and which accurate: step against stiffness and damping.

    python benchmarks/hard.py --map [--quick] [--write]

The drive is the README's, loaded within a tenth of the run, which is as long as a stretch wave
takes for five rounds. Steps are given times the fastest rate of the joints (the spectral bound):
2 sqrt(c/m) with little damping, more with much. Drawn in is where the stability polynomial of rk4
reaches 1 for one of two motions whose rates are known in closed form: the belt's shortest wave, and
the belt on its contact.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import attrs
import common
import judged
import numpy as np

import beltdyn as bd

Array = np.ndarray[Any, np.dtype[np.float64]]
METHODS = {
    "rk4": "rk4, explicit, order 4",
    "lbdf2": "lbdf2, implicit, order 2",
    "lie": "lie, implicit, order 1",
}
#: Colour of a cell and what it says.
LOOK = {
    "accurate": ("#009E73", "accurate: error below 1 % of the tension"),
    "stable": ("#56B4E9", "stable, but off by more"),
    "unstable": ("#E69F00", "stopped by an error that says why"),
    "wrong": ("#000000", "unstable without a word (must not happen)"),
}
ACCURATE = 0.01
ROUNDS = 5.0
#: Damping of the contact, share of critical.
SHARE_OF_CONTACT = 0.5
#: Step that is marked [s].
MARKED = 1e-5


def drive(contact: float, damping: float) -> bd.Params:
    """The README's; contact stiffness [N/m^2], and share of critical damping of the joints."""
    belt = bd.Belt(length=1.2, n_bodies=60, linear_density=0.1, axial_stiffness=70e3)
    critical = 2.0 * math.sqrt(70e3 * 0.1) * belt.length / belt.n_bodies / 2.0
    return bd.Params(
        belt=attrs.evolve(belt, axial_damping=damping * critical),
        pulleys=[
            bd.Pulley(center=(0.0, 0.0), radius=0.1, inertia=0.01),
            bd.Pulley(center=(0.29, 0.0), radius=0.1, inertia=0.01),
        ],
        contact=bd.Contact(
            linear=contact,
            damping=2.0 * SHARE_OF_CONTACT * math.sqrt(contact * 0.1),
            compensate=True,
        ),
        friction=bd.Dahl(mu_k=1.0, sigma=1e4),
    )


def eigenvalues(params: bd.Params) -> Array:
    """Of the shortest wave along the belt, and of a link on its contact [1/s]."""
    info, found = params.info, []
    for stiffness, damping in (
        (4.0 * info["joint_stiffness"], 4.0 * info["joint_damping"]),
        (info["contact_linear"], info["contact_damping"]),
    ):
        found += list(np.roots([info["link_mass"], damping, stiffness]))
    return np.array(found)


def longest(values: Array) -> float:
    """Longest stable step of rk4 [s]."""
    polynomial = [1.0 / math.factorial(k) for k in reversed(range(5))]
    steps = np.geomspace(1e-3, 1e2, 20_000) / np.max(np.abs(values))
    grown = np.abs(np.polyval(polynomial, np.outer(steps, values)))
    out = np.any(grown > 1.0 + 1e-6, axis=1)
    return float(steps[np.argmax(out)])


def ended(params: bd.Params, options: dict[str, Any], exact: Array, run: Callable[..., Any]) -> str:
    try:
        result = run(**options)
    except bd.SimulationError:
        return "unstable"
    force = result.joints.force
    error = common.rms_error(force, exact) if np.all(np.isfinite(force)) else math.inf
    if error <= ACCURATE:
        return "accurate"
    warned = judged.IN_TIME & {one.code for one in result.warnings}
    return "stable" if error <= 1.0 or warned else "wrong"


def column(params: bd.Params, ratios: Array) -> tuple[dict[str, list[str]], dict[str, float]]:
    """For each method how runs at these steps end; rk4's longest, and MARKED, times the bound."""
    info = params.info
    bound, wave = (
        info["spectral_bound"],
        2.0 * math.sqrt(info["joint_stiffness"] / info["link_mass"]),
    )
    t_end = 2.0 * params.belt.n_bodies / wave * ROUNDS
    torque = bd.PiecewiseLinear([0.0, 0.1 * t_end], [[0.0, 0.0], [-20.0, 20.0]])
    begin, times = bd.settle(params, tolerance=1e-7), np.linspace(0.0, t_end, 41)[1:]

    def run(**options: Any) -> bd.Result:
        return judged.quiet(params, torque, t_end, t_eval=times, initial=begin, **options)

    exact = run(method="rodas4", rtol=1e-7).joints.force
    found = {
        method: [ended(params, {"method": method, "step": r / bound}, exact, run) for r in ratios]
        for method in METHODS
    }
    return found, {"rk4": longest(eigenvalues(params)) * bound, "marked": MARKED * bound}


def study(quick: bool, write: bool) -> None:
    n = 5 if quick else 15
    ratios = np.geomspace(0.05, 60.0, 6 if quick else 29)
    sweeps = {
        "contact": (np.geomspace(7e7, 7e11, n), lambda x: drive(x, 0.1)),
        "damping": (np.geomspace(1e-2, 5.0, n), lambda x: drive(3.5e8, x)),
    }
    found = {}
    for name, (values, make) in sweeps.items():
        common.progress(name)
        found[name] = (values, [column(make(float(x)), ratios) for x in values])
    lines = ["Stable fixed steps, times the fastest rate of the joints", *common.machine(), ""]
    for name, (values, columns) in found.items():
        lines += ["", f"{name:>10s}" + "".join(f"{m:>24s}" for m in METHODS)
                  + "   closed form: rk4", " " * 10
                  + "   stable to  accurate to" * len(METHODS)]  # fmt: skip
        for x, (kinds, limits) in zip(values, columns, strict=True):
            row = "".join(
                f"{up_to(ratios, of, ('accurate', 'stable')):12.2f}"
                f"{up_to(ratios, of, ('accurate',)):12.2f}"
                for of in kinds.values()
            )
            lines.append(f"{x:10.3g}{row}{limits['rk4']:19.2f}")
    wrong = sum(of.count("wrong") for _, c in found.values() for kinds, _ in c for of in
                kinds.values())  # fmt: skip
    lines += ["", f"unstable without a word: {wrong}"]
    common.publish("hard_map", lines, write, draw(found, ratios))


def up_to(ratios: Array, kinds: list[str], good: tuple[str, ...]) -> float:
    """The longest step before the first that is not so; 0: none."""
    last = 0.0
    for ratio, kind in zip(ratios, kinds, strict=True):
        if kind not in good:
            break
        last = float(ratio)
    return last


def accurate_to(found: Any, ratios: Array) -> str:
    """How long an implicit step may be, whatever the contact."""
    columns = found["contact"][1]
    least = {
        method: min(up_to(ratios, of[method], ("accurate",)) for of, _ in columns)
        for method in ("lbdf2", "lie")
    }
    return f"lbdf2 is right to 1 % up to {least['lbdf2']:.0f}, lie up to {least['lie']:.0f}"


def draw(found: Any, ratios: Array) -> Any:
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    kinds = list(LOOK)
    colours = ListedColormap([LOOK[kind][0] for kind in kinds])
    labels = {
        "contact": "stiffness of the contact [N/m²]\n(the drive's own choice is 7·10⁸)",
        "damping": "damping along the belt, share of critical\n(the fastest rate grows with it)",
    }
    figure, axes = plt.subplots(
        len(METHODS), len(found), figsize=(7.6, 9.4), sharex="col", sharey=True, dpi=150
    )
    for k, (name, (values, columns)) in enumerate(found.items()):
        for m, (method, title) in enumerate(METHODS.items()):
            ax = axes[m, k]
            grid = [[kinds.index(kind) for kind in of[method]] for of, _ in columns]
            ax.pcolormesh(
                values, ratios, np.transpose(grid), cmap=colours, vmin=-0.5, vmax=len(kinds) - 0.5,
                shading="nearest", edgecolors="w", lw=0.2,
            )  # fmt: skip
            ax.set(xscale="log", yscale="log")
            ax.set_title(title, fontsize=9)
            ax.plot(values, [limits["marked"] for _, limits in columns], "k:", lw=1.2)
            if method == "rk4":
                ax.plot(values, [limits["rk4"] for _, limits in columns], "k-", lw=1.8)
            ax.set_ylim(float(ratios[0]), float(ratios[-1]))
            ticks = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0)
            ax.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
            ax.minorticks_off()
        axes[-1, k].set_xlabel(labels[name])
    axes[1, 0].set_ylabel("step times fastest rate of the joints [rad]  (longer steps upwards)")
    every = [of for _, columns in found.values() for of, _ in columns]
    shown = {kind for of in every for kinds_of in of.values() for kind in kinds_of}
    handles = [
        Patch(facecolor=colour, label=text)
        for kind, (colour, text) in LOOK.items()
        if kind in shown or kind != "wrong"
    ]
    handles += axes[0, 0].plot([], [], "k-", lw=1.8, label="rk4's limit, in closed form")
    handles += axes[0, 0].plot([], [], "k:", lw=1.2, label=f"a step of {1e6 * MARKED:g} µs")
    figure.suptitle("How long may a step be?", y=0.99, fontsize=13, fontweight="bold")
    told = (
        "Explicit steps have a limit in closed form: stiffer contact, shorter steps.\n"
        + accurate_to(found, ratios)
        + " over the fastest rate\nof the joints; longer steps only lose accuracy, until the "
        "solver gives up (top right)."
    )
    figure.text(0.5, 0.938, told, ha="center", va="center", fontsize=9)
    figure.legend(handles=handles, loc="lower center", ncols=2, fontsize=8, frameon=False)
    figure.tight_layout(rect=(0.0, 0.085, 1.0, 0.955))
    return figure
