"""The command line: ``beltdyn show SCENE``, ``beltdyn run SCENE``, ``beltdyn figures`` and more.

Exit codes: 0 fine, 1 the run failed or a file could not be written, 2 bad input, 130 interrupted. A
run that fails or is interrupted still writes what it computed. Results go to stdout; errors and
warnings, one line each after the results, to stderr. Warnings do not change the exit code.
"""

from __future__ import annotations

import io
import os
import signal
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import click

from . import __version__, accuracy, files, sanity, scenes
from .accuracy.quantities import QUANTITIES
from .accuracy_report import Accuracy
from .errors import Interrupted, SimulationError
from .explaining import explain
from .params import Params
from .result import Result
from .run_warnings import RunWarning, distinct, silenced
from .simulation import METHODS, simulate

__all__ = ["main"]

_FAILED, _BAD_INPUT, _INTERRUPTED = 1, 2, 130
#: Signals sent by batch systems and closed terminals; Windows has no SIGHUP.
_ENDING = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]


def _stop(message: str, code: int) -> NoReturn:
    click.echo(f"beltdyn: {message}", err=True)
    sys.exit(code)


def _warn(noticed: Iterable[RunWarning], quiet: bool) -> None:
    """Print each on a line of its own, yellow on a terminal."""
    if quiet:
        return
    from rich.console import Console

    console = Console(stderr=True)
    for one in noticed:
        line = f"beltdyn: warning: {one}"
        console.print(line, style="yellow", markup=False, highlight=False, soft_wrap=True)


def _interrupt_once(*_: object) -> NoReturn:
    """Answer the first signal and ignore those after it, so that results are still written."""
    for one in (signal.SIGINT, *_ENDING):
        signal.signal(one, signal.SIG_IGN)
    raise KeyboardInterrupt


@contextmanager
def _interruptible() -> Iterator[None]:
    """Treat the signals that end a batch job like Ctrl-C, and answer only the first."""
    before = [(one, signal.signal(one, _interrupt_once)) for one in (signal.SIGINT, *_ENDING)]
    try:
        yield
    finally:
        for one, old in before:
            if signal.getsignal(one) is _interrupt_once:  # not so once a signal was answered
                signal.signal(one, old)


class _Group(click.Group):
    """Reports errors in one line, never as a traceback."""

    def main(self, *args: Any, **options: Any) -> Any:
        try:
            code = super().main(*args, **(options | {"standalone_mode": False}))
        except click.exceptions.NoArgsIsHelpError as error:
            click.echo(error.format_message())
            sys.exit(0)
        except click.ClickException as error:
            context = error.ctx if isinstance(error, click.UsageError) else None
            hint = f" (try: {context.command_path} --help)" if context else ""
            _stop(f"{error.format_message()}{hint}", _BAD_INPUT)
        except click.Abort:
            _stop("interrupted", _INTERRUPTED)
        except MemoryError as error:
            _stop(str(error) or "out of memory", _FAILED)
        except OSError as error:
            # Standard output is closed or full: nothing more can be printed there.
            sys.stdout = open(os.devnull, "w")  # noqa: SIM115
            _stop(f"cannot write: {error.strerror}", _FAILED)
        sys.exit(code if isinstance(code, int) else 0)


@click.group("beltdyn", cls=_Group, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="beltdyn")
def main() -> None:
    """Dynamics of belt drives.

    \b
    beltdyn scenes                                   list the built-in scenes
    beltdyn show three-pulleys --plot layout.png     look at one before it runs
    beltdyn run kubas-case-1 --plot case1.png        run one, draw an overview
    beltdyn run drive.toml --out drive.npz           run a scene of your own
    beltdyn run drive.toml --outputs span_tension    compute and keep nothing else
    beltdyn run kubas-case-1 --verify                how accurate is it?
    beltdyn run kubas-case-1 --error 1e-2            run it as cheaply as 1 % allows
    beltdyn accuracy kubas-case-1 --plot price.png   what does accuracy cost?
    beltdyn explain serpentine                       what does it simulate, why, at what price?
    beltdyn figures --out figures                    draw the paper's figures

    Write a scene file to start from with
    beltdyn.scenes.kubas_case_1().to_toml("drive.toml"), and read results with
    beltdyn.Result.load("drive.npz").

    Exit codes: 0 done, 1 the run failed or a file could not be written, 2 bad input, 130
    interrupted (Ctrl-C or SIGTERM). What was computed before is written in each case. Warnings
    go to stderr after the results and do not change the exit code.
    """


@main.command("scenes")
def list_scenes() -> None:
    """List the named scenes."""
    width = max(map(len, scenes.names()))
    for name in scenes.names():
        click.echo(f"{name:<{width}}  {scenes.describe(name)}")


@main.command()
@click.argument("scene")
@click.option("--plot", type=click.Path(path_type=Path), help="Draw the layout here.")
def show(scene: str, plot: Path | None) -> None:
    """Show the drive of SCENE before anything runs: its data, and the way of the belt.

    SCENE is a name from `beltdyn scenes` or a TOML file.
    """
    outputs = _Outputs(None, plot, None, False)
    outputs.check()
    try:
        params = _find(scene).params
    except OSError as error:
        _stop(f"cannot read {error.filename}: {error.strerror}", _BAD_INPUT)
    except (TypeError, ValueError) as error:
        _stop(str(error), _BAD_INPUT)
    click.echo(f"{params}\n\n{params.route}")
    if plot is not None:
        try:
            _draw_layout(params, plot)
        except OSError as error:
            _stop(f"cannot write {plot}: {error.strerror or error}", _FAILED)
        click.echo(f"written: {plot}")


@main.command()
@click.argument("scene")
@click.option("--out", type=click.Path(path_type=Path), help="Write the result here (.npz).")
@click.option("--plot", type=click.Path(path_type=Path), help="Write an overview figure here.")
@click.option(
    "--animate", type=click.Path(path_type=Path), help="Write a film (.gif, .mp4, .html)."
)
@click.option("--method", type=click.Choice(METHODS), default="auto", show_default=True)
@click.option("--rtol", type=float, default=1e-4, show_default=True, help="Error asked for.")
@click.option("--step", type=float, help="Fixed step [s] of rk4, lbdf2, lie; else the first step.")
@click.option("--t-end", type=float, help="End of the run [s], instead of the scene's.")
@click.option("--verify", is_flag=True, help="Run again, finer, on other meshes: print the errors.")
@click.option(
    "--error", type=float, help="Choose method, rtol and links for this error, 0.01: 1 %."
)
@click.option(
    "--quantity",
    type=click.Choice(QUANTITIES),
    default="tension",
    show_default=True,
    help="What --error is the error of.",
)
@click.option(
    "--budget", type=float, help="Choose the most accurate of them for this CPU time [s]."
)
@click.option(
    "--outputs", help="What to compute and keep, by comma: pulleys,span_tension,joints.force."
)
@click.option("--verbose", is_flag=True, help="Print what the integrator did, too.")
@click.option("--quiet", is_flag=True, help="Print nothing but errors; --out keeps the warnings.")
@click.pass_context
def run(
    context: click.Context,
    scene: str,
    out: Path | None,
    plot: Path | None,
    animate: Path | None,
    method: str,
    rtol: float,
    step: float | None,
    t_end: float | None,
    verify: bool,
    error: float | None,
    quantity: str,
    budget: float | None,
    outputs: str | None,
    verbose: bool,
    quiet: bool,
) -> None:
    """Run SCENE, a name from `beltdyn scenes` or a TOML file."""
    written_to = _Outputs(out, plot, animate, quiet)
    written_to.check()
    _check_choice(context, error, budget)
    if outputs is not None and (plot is not None or animate is not None):
        _stop("--plot and --animate draw from all outputs: leave --outputs out", _BAD_INPUT)
    names = None if outputs is None else tuple(filter(None, map(str.strip, outputs.split(","))))
    suggestion = None
    try:
        found = _find(scene)
        if t_end is not None:
            found = found._replace(t_end=t_end)
        params = found.params
        options: dict[str, Any] = {"method": method, "rtol": rtol, "step": step, "budget": budget}
        with _interruptible(), silenced():
            if error is not None:
                suggestion = accuracy.suggest(found, error, quantity)
                found, options = suggestion.scene, suggestion.options
                params = found.params
            result = simulate(
                params,
                found.torque_fn,
                found.t_end,
                motion=found.motion,
                progress=not quiet,
                verify=verify,
                outputs=names,
                **options,
            )
    except OSError as error:
        _stop(f"cannot read {error.filename}: {error.strerror}", _BAD_INPUT)
    except (TypeError, ValueError) as error:
        _stop(str(error), _BAD_INPUT)
    except SimulationError as error:
        written = written_to.write(error.result)
        _warn(error.result.warnings if error.result else sanity.check(params), quiet)
        _stop(f"{error}{written}", _FAILED)
    except Interrupted as error:
        written = written_to.write(error.result)
        _warn(error.result.warnings if error.result else (), quiet)
        _stop(f"{error}{written}", _INTERRUPTED)
    except KeyboardInterrupt:
        _stop("interrupted", _INTERRUPTED)
    try:
        with _interruptible():
            written = written_to.write(result)
    except KeyboardInterrupt:
        _stop("interrupted while the result was written", _INTERRUPTED)
    if not quiet:
        if suggestion is not None:
            click.echo(f"{suggestion}\n")
        _print_summary(scene, result, written, verbose or budget is not None)
        if verify:
            _print_accuracy(result.accuracy)
    _warn(result.warnings, quiet)


def _check_choice(context: click.Context, error: float | None, budget: float | None) -> None:
    """Stop if what --error or --budget chooses is given as well, or nothing to choose by."""

    def given(name: str) -> bool:
        return context.get_parameter_source(name) is click.core.ParameterSource.COMMANDLINE

    if error is None and given("quantity"):
        _stop("--quantity is what --error is the error of: give both, or neither", _BAD_INPUT)
    for option, value in (("--error", error), ("--budget", budget)):
        if value is None:
            continue
        others = ["method", "rtol", "step"] + (["verify", "error"] if option == "--budget" else [])
        for name in others:
            if given(name):
                _stop(f"{option} and --{name} must not be given together", _BAD_INPUT)


@main.command("accuracy")
@click.argument("scene")
@click.option(
    "--quantity",
    type=click.Choice(QUANTITIES),
    default="tension",
    show_default=True,
    help="What table and figure show the errors of.",
)
@click.option("--error", type=float, default=1e-2, show_default=True, help="Error to mark.")
@click.option("--out", type=click.Path(path_type=Path), help="Write all runs here (.csv).")
@click.option("--plot", type=click.Path(path_type=Path), help="Write a figure here.")
@click.option(
    "--store",
    type=click.Path(path_type=Path),
    help="Keep runs here (JSON lines); those there are not repeated.",
)
@click.option("--quick", is_flag=True, help="Fewer and coarser meshes, fewer tolerances.")
@click.option("--quiet", is_flag=True, help="Print nothing but errors.")
def study_accuracy(
    scene: str,
    quantity: str,
    error: float,
    out: Path | None,
    plot: Path | None,
    store: Path | None,
    quick: bool,
    quiet: bool,
) -> None:
    """Measure what accuracy costs: SCENE by method, tolerance and number of links.

    SCENE is a name from `beltdyn scenes` or a TOML file. Takes some minutes on two processors, with
    --quick less than one.
    """
    outputs = _Outputs(out, plot, None, quiet)
    outputs.check()
    try:
        found = _find(scene)
        options = accuracy.quick(found.params) if quick else {}
        with _interruptible(), silenced():
            study = accuracy.study(found, store=store, progress=not quiet, **options)
        text = f"{study}\n\n{study.table(quantity)}"
        figure = None if plot is None else study.plot(quantity, error=error)
    except OSError as failure:
        _stop(f"cannot read or write {failure.filename}: {failure.strerror}", _BAD_INPUT)
    except (TypeError, ValueError) as failure:
        _stop(str(failure), _BAD_INPUT)
    except SimulationError as failure:
        _stop(str(failure), _FAILED)
    except (Interrupted, KeyboardInterrupt):
        kept = "" if store is None else f"; finished runs are in {store}"
        _stop(f"interrupted{kept}", _INTERRUPTED)
    written = []
    try:
        if out is not None:
            study.to_csv(out)
            written.append(str(out))
        if plot is not None and figure is not None:
            with files.replacing(plot) as temporary:
                figure.savefig(temporary, format=plot.suffix[1:].lower())
            written.append(str(plot))
    except OSError as failure:
        _stop(f"cannot write {failure.filename}: {failure.strerror}", _FAILED)
    if not quiet:
        click.echo(text)
        if written:
            click.echo(f"written: {', '.join(written)}")


@main.command("explain")
@click.argument("scene")
@click.option("--error", type=float, default=1e-2, show_default=True, help="Error asked for.")
@click.option(
    "--budget", type=float, default=8.0, show_default=True, help="CPU time for it, about [s]."
)
@click.option("--method", type=click.Choice(METHODS), default="auto", show_default=True)
@click.option("--t-end", type=float, help="End of the run [s], instead of the scene's.")
def explain_scene(
    scene: str, error: float, budget: float, method: str, t_end: float | None
) -> None:
    """Tell which effects SCENE simulates, what calls for them, what they cost and change.

    SCENE is a name from `beltdyn scenes` or a TOML file. Lists the effects that are on and off, the
    size of the state by part, the passes of a step with their times on this machine, what leaving
    out one effect at a time changes, and which may be left out at the error asked for.
    """
    try:
        found = _find(scene)
        with _interruptible():
            explanation = explain(
                found.params,
                found.torque_fn,
                found.t_end if t_end is None else t_end,
                found.motion,
                error=error,
                budget=budget,
                method=method,
            )
    except OSError as failure:
        _stop(f"cannot read {failure.filename}: {failure.strerror}", _BAD_INPUT)
    except (TypeError, ValueError) as failure:
        _stop(str(failure), _BAD_INPUT)
    except SimulationError as failure:
        _stop(str(failure), _FAILED)
    except (Interrupted, KeyboardInterrupt):
        _stop("interrupted", _INTERRUPTED)
    click.echo(str(explanation))


@main.command("figures")
@click.option(
    "--out",
    "folder",
    type=click.Path(path_type=Path),
    required=True,
    help="Folder to write to; made if it is not there.",
)
@click.option(
    "--format", "formats", default="png,pdf", show_default=True, help="Kinds of file, by comma."
)
@click.option(
    "--size",
    type=click.Choice(["notebook", "print"]),
    default="print",
    show_default=True,
    help="print: panels as wide as a journal's column.",
)
@click.option("--quiet", is_flag=True, help="Print nothing but errors.")
def draw_figures(folder: Path, formats: str, size: str, quiet: bool) -> None:
    """Draw the paper's figures 5 to 19 from new runs, and the table of its numbers beside ours.

    Writes fig-05.png, fig-05.pdf and so on, and table.txt.
    """
    try:
        _check_folder(folder)
    except OSError as error:
        _stop(f"cannot write to {folder}: {error.strerror}", _BAD_INPUT)
    _need_matplotlib("beltdyn figures")
    kinds = [kind.strip().lower().removeprefix(".") for kind in formats.split(",")]
    known = _figure_kinds()
    for kind in kinds:
        if kind not in known:
            _stop(f"--format: {kind!r} must be one of {', '.join(known)}", _BAD_INPUT)
    written: list[Path] = []
    try:
        with _interruptible():
            comparison, noticed = _write_figures(
                folder, list(dict.fromkeys(kinds)), size, quiet, written
            )
    except SimulationError as error:
        _stop(str(error), _FAILED)
    except OSError as error:
        _stop(f"cannot write {error.filename or folder}: {error.strerror or error}", _FAILED)
    except KeyboardInterrupt as error:
        so_far = f"; {len(written)} files written to {folder}" if written else ""
        _stop(f"{str(error) or 'interrupted'}{so_far}", _INTERRUPTED)
    if not quiet:
        click.echo(comparison)
        click.echo(f"written: {len(written)} files in {folder}")
    _warn(noticed, quiet)


def _write_figures(
    folder: Path, kinds: list[str], size: str, quiet: bool, written: list[Path]
) -> tuple[str, list[RunWarning]]:
    from . import kubas
    from .kubas.figures import FIGURES

    with silenced():
        runs = kubas.runs(progress=not quiet)
    comparison = str(kubas.compare(runs))
    folder.mkdir(exist_ok=True)

    def write(name: str, content: bytes) -> None:
        path = folder / name
        files.write_bytes(path, content)
        written.append(path)

    write("table.txt", f"{comparison}\n".encode())
    hidden = quiet or not sys.stderr.isatty()
    with click.progressbar(
        FIGURES.values(), label="drawing", file=sys.stderr, hidden=hidden
    ) as figures:
        for figure in figures:
            drawn = figure(runs, size=size)
            for kind in kinds:
                picture = io.BytesIO()
                drawn.savefig(picture, format=kind)
                write(f"fig-{figure.number:02d}.{kind}", picture.getvalue())
    return comparison, distinct(run.warnings for run in runs)


def _check_folder(folder: Path) -> None:
    """Check before the runs that files can be written there, or the folder be made."""
    if folder.exists() and not folder.is_dir():
        _stop(f"cannot write to {folder}: it is a file", _BAD_INPUT)
    if not folder.exists() and not folder.parent.is_dir():
        _stop(f"cannot write to {folder}: there is no folder {folder.parent}", _BAD_INPUT)
    # Any name serves to find out whether files can be made there.
    files.check_writable((folder if folder.exists() else folder.parent) / "table.txt")


def _find(scene: str) -> scenes.Scene:
    if os.path.isdir(scene):
        raise ValueError(f"{scene} is a folder, not a scene")
    if scene.endswith(".toml") or os.path.isfile(scene):
        return scenes.Scene.from_toml(Path(scene))
    return scenes.get(scene)


def _check_writable(path: Path) -> None:
    """Check before the run, which may take long, that the file can be written after it."""
    folder = path.parent
    if not folder.is_dir():
        _stop(f"cannot write {path}: there is no folder {folder}", _BAD_INPUT)
    if path.is_dir():
        _stop(f"cannot write {path}: it is a folder", _BAD_INPUT)
    # Makes and removes a temporary file in the folder, as writing will.
    files.check_writable(path)


def _need_matplotlib(what: str) -> None:
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        _stop(
            f"{what} needs matplotlib: python -m pip install matplotlib (or beltdyn[plot])",
            _BAD_INPUT,
        )


def _figure_kinds() -> list[str]:
    from matplotlib.backend_bases import FigureCanvasBase

    return list(FigureCanvasBase.get_supported_filetypes())


def _check_plot(path: Path) -> None:
    _need_matplotlib("--plot")
    kinds = _figure_kinds()
    if path.suffix[1:].lower() not in kinds:
        _stop(f"cannot plot to {path}: its ending must be one of {', '.join(kinds)}", _BAD_INPUT)


def _check_film(path: Path) -> None:
    try:
        from .plot.animation import film_writer

        film_writer(path)
    except ImportError as error:
        _stop(f"--animate {path}: {error}", _BAD_INPUT)
    except ValueError as error:
        _stop(f"--animate: {error}", _BAD_INPUT)


class _Outputs(NamedTuple):
    """The files that were asked for."""

    out: Path | None
    plot: Path | None
    animate: Path | None
    quiet: bool

    def check(self) -> None:
        """Stop before the run if a file could not be written after it."""
        named = {
            option: path
            for option, path in (
                ("--out", self.out),
                ("--plot", self.plot),
                ("--animate", self.animate),
            )
            if path is not None
        }
        for path in named.values():
            try:
                _check_writable(path)
            except OSError as error:
                _stop(f"cannot write {path}: {error.strerror}", _BAD_INPUT)
        for (one, path), (other, same) in combinations(named.items(), 2):
            if path == same:
                _stop(f"{one} and {other} must not be the same file, {path}", _BAD_INPUT)
        if self.plot is not None:
            _check_plot(self.plot)
        if self.animate is not None:
            _check_film(self.animate)

    def write(self, result: Result | None) -> str:
        """Write them; return a line that lists what was written."""
        if result is None:
            return ""
        drawable = result.t.size > 0
        written = []
        for path, write in (
            (self.out, result.save),
            (self.plot if drawable else None, lambda path: _draw(result, path)),
            (self.animate if drawable else None, lambda path: _film(result, path, self.quiet)),
        ):
            if path is None:
                continue
            try:
                write(path)
            except OSError as error:
                _stop(f"cannot write {path}: {error.strerror or error}", _FAILED)
            written.append(str(path))
        what = "" if result.success else " (up to that time)"
        return f"\nwritten{what}: {', '.join(written)}" if written else ""


def _draw(result: Result, path: Path) -> None:
    from .plot import overview

    with files.replacing(path) as temporary:
        overview(result).savefig(temporary, format=path.suffix[1:].lower())


def _draw_layout(params: Params, path: Path) -> None:
    from .plot import layout
    from .plot.style import new_figure

    figure = new_figure()
    layout(params, ax=figure.add_subplot())
    with files.replacing(path) as temporary:
        figure.savefig(temporary, format=path.suffix[1:].lower())


def _film(result: Result, path: Path, quiet: bool) -> None:
    from .plot import animate

    film = animate(result)
    hidden = quiet or not sys.stderr.isatty()
    with click.progressbar(
        length=film.frames, label="animating", file=sys.stderr, hidden=hidden
    ) as bar:
        film.save(path, progress_callback=lambda _frame, _frames: bar.update(1))


def _print_accuracy(report: Accuracy) -> None:
    from rich.console import Console
    from rich.table import Table

    heading, *rows = report.table()
    table = Table(title="estimated errors", title_justify="left")
    for k, label in enumerate(heading):
        table.add_column(label, justify="right" if k else "left")
    for row in rows:
        table.add_row(*row)
    Console().print(table)
    for remark in report.remarks():
        click.echo(f"  {remark}")


def _print_summary(scene: str, result: Result, written: str, verbose: bool) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title=scene, show_header=False, title_justify="left")
    for label, value in result.summary(verbose):
        table.add_row(label, value)
    Console().print(table)
    if written:
        click.echo(written.strip())
