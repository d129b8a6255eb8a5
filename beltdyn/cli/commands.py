"""The commands on a scene: show, run, resume, accuracy, explain; the list of scenes."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path
from textwrap import fill
from typing import Any

import attrs
import click

from .. import __version__, accuracy, scenes
from ..base.checks import one_of, positive, share_of_run
from ..base.run_options import BY_BUDGET
from ..base.run_warnings import silenced
from ..base.tables import columns
from ..drive.parts import CHOOSE
from ..drive.scene import Scene
from ..run.checkpoints import Checkpoint, Continued, Fresh
from ..run.resuming import resume
from ..run.simulation import simulate
from ..scenes.hard_scenes import SCENES as HARD
from ..scenes.hard_scenes import HardScene
from ..verification.quantities import QUANTITIES
from .command_options import PATH, Asked, option, options
from .ending import BAD_INPUT, Group, interruptible, reported, stop
from .written import check_files, finish, running, save_figure, write_files


@click.group("beltdyn", cls=Group, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="beltdyn")
def main() -> None:
    """Dynamics of belt drives.

    \b
    beltdyn scenes                                   list the built-in scenes
    beltdyn scenes --hard                            list those made to break an integrator
    beltdyn run hard/sigma-1e8                       run one of these
    beltdyn run serpentine --mesh ale                with a belt that flows through cells
    beltdyn show three-pulleys --plot layout.png     look at one before it runs
    beltdyn run kubas-case-1 --plot case1.png        run one, draw an overview
    beltdyn run drive.toml --out drive.npz           run a scene of your own (.nc, .csv, .mat)
    beltdyn run drive.toml --outputs span_tension    compute and keep nothing else
    beltdyn run drive.toml --checkpoint drive.run    write it as it goes, in case it is killed
    beltdyn resume drive.run --out drive.npz         go on with it as if it had not been
    beltdyn run kubas-case-1 --verify                how accurate is it?
    beltdyn run kubas-case-1 --error 1e-2            run it as cheaply as 1 % allows
    beltdyn accuracy kubas-case-1 --plot price.png   what does accuracy cost?
    beltdyn explain serpentine                       what does it simulate, why, at what price?
    beltdyn sweep sweep.toml --out sweep.nc          run one with parameters changed, many times
    beltdyn figures --out figures                    draw the paper's figures

    Write a scene file to start from with
    beltdyn.scenes.kubas_case_1().to_toml("drive.toml"), and read results with
    beltdyn.Result.load("drive.npz").

    Exit codes: 0 done (a hard scene may have to end in an error), 1 the run failed or a file could
    not be written, 2 bad input, 130 interrupted (Ctrl-C or SIGTERM). What was computed before
    is written in each case. Warnings go to stderr after the results and do not change the exit
    code.
    """


@main.command("scenes")
@click.option(
    "--hard",
    is_flag=False,
    flag_value="all",
    metavar="[FAMILY]",
    help="List the hard ones, or those of a family: what each provokes.",
)
def list_scenes(hard: str | None) -> None:
    """List the named scenes; with --hard those that are made to break an integrator."""
    if hard is not None:
        _list_hard(hard)
        return
    rows = [(name, scenes.describe(name)) for name in scenes.names()]
    click.echo("\n".join(columns(rows, "<", "")))
    click.echo(f"\nand {len(HARD)} made to break an integrator: beltdyn scenes --hard")


def _list_hard(family: str) -> None:
    """List the hard scenes of a family, or "all"."""
    families = list(dict.fromkeys(one.family for one in HARD.values()))
    with reported():
        one_of("--hard", family, ("all", *families))
    found = [one for one in HARD.values() if family in ("all", one.family)]
    click.echo(f"{len(found)} scenes made to break an integrator; run one: beltdyn run hard/NAME")
    width = max(map(len, HARD))
    for name, group in groupby(found, key=lambda one: one.family):
        rows = [
            (f"{one.name:<{width}}", one.provokes + (" [ends in an error]" if one.expects else ""))
            for one in group
        ]
        click.echo("\n".join(["", name, *columns(rows, "<", width=96)]))


def _find(asked: Asked) -> Scene | HardScene:
    """Return the scene of a name or a file, its belt on another mesh if one is named."""
    found = scenes.find(asked.scene)
    if asked.mesh is None:
        return found
    if isinstance(found, HardScene):
        raise ValueError(f"--mesh: hard/{found.name} is of its own mesh")
    belt = found.params.belt
    n_bodies = None if asked.mesh in CHOOSE else belt.n_bodies
    belt = attrs.evolve(belt, mesh=asked.mesh, n_bodies=n_bodies)
    return found._replace(params=attrs.evolve(found.params, belt=belt))


@main.command()
@click.argument("scene")
@options("mesh", option("plot", PATH, "Draw the layout here."))
def show(asked: Asked) -> None:
    """Show the drive of SCENE before anything runs: its data, and the way of the belt.

    SCENE is a name from `beltdyn scenes` or a TOML file.
    """
    check_files(asked)
    with reported():
        found = _find(asked)
    if isinstance(found, HardScene):
        click.echo(f"{found.told}\n")
    click.echo(f"{found.params}\n\n{found.params.route}")

    def draw(path: Path) -> None:
        from ..plot import layout
        from ..plot.style import new_figure

        figure = new_figure()
        layout(found.params, ax=figure.add_subplot())
        save_figure(figure, path)

    if written := write_files((asked.plot, draw)):
        click.echo(f"written: {written}")


@main.command()
@click.argument("scene")
@options(
    "mesh out plot animate method rtol step t_end",
    option("verify", bool, "Run again, finer, on other meshes: print the errors."),
    option("error", float, "Choose method, rtol and n_bodies for this error, 0.01: 1 %."),
    option("quantity", click.Choice(QUANTITIES), "Quantity whose error --error is.", "tension"),
    option("budget", float, "Choose those that are most accurate for this CPU time [s]."),
    option(
        "outputs", str, "What to compute and keep, with commas: pulleys,span_tension,joints.force."
    ),
    "last",
    option(
        "checkpoint",
        PATH,
        "Write the run here as it goes; `beltdyn resume` goes on with it after a kill.",
    ),
    option("checkpoint_every", float, "Wall time between two of these writes [s].", 30.0),
    "full verbose quiet_run",
)
def run(asked: Asked) -> None:
    """Run SCENE, a name from `beltdyn scenes` or a TOML file, and print a report of it.

    The report is of the last part of the run: speeds, torques, powers, hub loads and margins to
    slip of the pulleys, tensions of the spans, efficiency, errors; with --full also arcs of
    contact, creep by its causes, where power goes, load cycles.
    """
    with reported():
        share_of_run("--last", asked.last)
    check_files(asked)
    _check_together(asked)
    outputs = asked.outputs
    if outputs is not None:
        outputs = tuple(filter(None, map(str.strip, outputs.split(","))))
    suggestion, hard = None, None
    chosen = {name: getattr(asked, name) for name in (*BY_BUDGET, "budget")}
    with reported("read" if asked.checkpoint is None else "read or write"):
        if asked.checkpoint is not None:
            chosen["checkpoint"] = Checkpoint(asked.checkpoint, asked.checkpoint_every)
            Fresh(chosen["checkpoint"]).close()  # before anything takes long
        found = _find(asked)
        if asked.t_end is not None:
            found = found._replace(t_end=asked.t_end)
        if isinstance(found, HardScene):
            hard = found
            chosen |= _of_hard(asked, found)
        with running(asked, asked.checkpoint, lambda: found.params, hard):
            if isinstance(found, HardScene):
                chosen["initial"] = found.initial()
            if asked.error is not None:
                suggestion = accuracy.suggest(found, asked.error, asked.quantity)
                found = suggestion.scene
                chosen |= suggestion.options
            result = simulate(
                found.params,
                found.torque_fn,
                found.t_end,
                motion=found.motion,
                progress=not asked.quiet,
                verify=asked.verify,
                outputs=outputs,
                **chosen,
            )
    before = "" if suggestion is None else f"{suggestion}\n\n"
    if asked.budget is not None:
        before = f"{fill('Chosen for' + result.message.partition('; chosen for')[2], 88)}.\n\n"
    after = ""
    if hard is not None and not asked.quiet:
        off = hard.deviation(result) if outputs is None and suggestion is None else None
        after = f"\n{hard.told}{_kept(off)}\n"
    finish(asked, asked.scene, result, asked.checkpoint, before, after)


def _kept(off: float | None) -> str:
    """Return the line on a deviation over what is allowed; laws enforce limits, which 1 reaches."""
    if off is None:
        return ""
    if not off <= 1.0:
        return f"\nNOT KEPT deviation {off:.2g} times what is allowed"
    reached = "the limit is reached, not passed"
    return f"\nkept     {reached if off > 0.999 else f'deviation {off:.2g} of what is allowed'}"


def _of_hard(asked: Asked, scene: HardScene) -> dict[str, Any]:
    """Return the options of a hard scene that the command line leaves open."""
    if scene.starts and (asked.error is not None or asked.budget is not None):
        stop(
            f"hard/{scene.name} begins in a state of its own mesh: leave --error and --budget out",
            BAD_INPUT,
        )
    return {name: value for name, value in scene.options.items() if not asked.given(name)}


def _check_together(asked: Asked) -> None:
    """Stop if an option is without the one it belongs to, or with one that leaves it no room."""
    for one, other, what in (
        ("quantity", "error", "what --error is the error of"),
        ("checkpoint_every", "checkpoint", "how often --checkpoint is written"),
    ):
        if asked.given(one) and getattr(asked, other) is None:
            stop(f"--{one.replace('_', '-')} is {what}: give both, or neither", BAD_INPUT)
    for one, others, message in (
        ("error", BY_BUDGET, "--error and --{} must not be given together"),
        ("budget", (*BY_BUDGET, "verify", "error"), "--budget and --{} must not be given together"),
        (
            "checkpoint",
            ("verify", "budget"),
            "--checkpoint is of one run, --{} makes several: leave one out",
        ),
        (
            "outputs",
            ("plot", "animate"),
            "--plot and --animate draw from all outputs: leave --outputs out",
        ),
    ):
        for other in others:
            if getattr(asked, one) is not None and asked.given(other):
                stop(message.format(other), BAD_INPUT)


@main.command("resume")
@click.argument("file", type=PATH)
@options(
    "out plot animate last",
    option("checkpoint_every", float, "Wall time between two writes of FILE [s]."),
    "full verbose quiet_run",
)
def resume_run(asked: Asked) -> None:
    """Go on with the run in FILE, which `beltdyn run --checkpoint FILE` wrote, as if not stopped.

    The result is that of the whole run, the same bit for bit; that of a finished run is read again.
    FILE goes on being written, so that this may be killed as well.
    """
    file = asked.file
    with reported():
        share_of_run("--last", asked.last)
    check_files(asked)
    if file in (asked.out, asked.plot, asked.animate):
        stop(f"{file} is the run itself: write to another file", BAD_INPUT)
    if asked.plot is not None or asked.animate is not None:
        with reported(), Continued(file, write=False, every=None) as run:
            if run.start.outputs is not None:
                stop("--plot and --animate draw from all outputs, the run has some", BAD_INPUT)
    with reported("read or write"), running(asked, file):
        result = resume(file, progress=not asked.quiet, every=asked.checkpoint_every)
    finish(asked, file, result, file)


@main.command("accuracy")
@click.argument("scene")
@options(
    "mesh",
    option(
        "quantity", click.Choice(QUANTITIES), "What table and figure show the errors of.", "tension"
    ),
    option("error", float, "Error to mark.", 1e-2),
    option("out", PATH, "Write all runs here (.csv)."),
    option("plot", PATH, "Write a figure here."),
    option("store", PATH, "Folder that keeps runs; those found there are not repeated."),
    option("quick", bool, "Fewer meshes and tolerances, the beginning of long runs."),
    "quiet",
)
def study_accuracy(asked: Asked) -> None:
    """Measure what accuracy costs: SCENE by method, tolerance and number of links or cells.

    SCENE is a name from `beltdyn scenes` or a TOML file. The paper's case 1 takes some minutes on
    two processors, finer and longer scenes more; with --quick any takes 10 to 30 s of CPU time.
    """
    check_files(asked, (".csv",))

    def kept() -> str:
        return "" if asked.store is None else f"; finished runs are in {asked.store}"

    with reported("read or write", kept):
        positive("error", asked.error)  # before what takes minutes
        found = _find(asked)
        chosen: dict[str, Any] = {}
        text = ""
        with interruptible(), silenced():
            if asked.quick:
                whole = found.t_end
                found, chosen = accuracy.quick(found)
                if found.t_end < whole:
                    text = f"Of the first {found.t_end:.3g} of {whole:.3g} s only.\n"
            study = accuracy.study(found, store=asked.store, progress=not asked.quiet, **chosen)
        text += f"{study}\n\n{study.table(asked.quantity)}"
        figure = asked.plot and study.plot(asked.quantity, error=asked.error)
    written = write_files(
        (asked.out, study.to_csv), (asked.plot, lambda path: save_figure(figure, path))
    )
    if not asked.quiet:
        click.echo(text)
        if written:
            click.echo(f"written: {written}")


@main.command("explain")
@click.argument("scene")
@options(
    "mesh",
    option("error", float, "Error asked for.", 1e-2),
    option("budget", float, "CPU time for it, about [s].", 30.0),
    "method t_end",
)
def explain_scene(asked: Asked) -> None:
    """Show which effects SCENE simulates, what calls for them, what they cost and change.

    SCENE is a name from `beltdyn scenes` or a TOML file. Lists the effects that are on and off, the
    size of the state by part, the passes of a step with their times on this machine, what leaving
    out one effect at a time changes, and which may be left out at the error asked for.
    """
    from ..explaining import explain  # which other commands, and help, do not need

    with reported():
        found = _find(asked)
        with interruptible():
            explanation = explain(
                found.params,
                found.torque_fn,
                found.t_end if asked.t_end is None else asked.t_end,
                found.motion,
                error=asked.error,
                budget=asked.budget,
                method=asked.method,
            )
    click.echo(str(explanation))
