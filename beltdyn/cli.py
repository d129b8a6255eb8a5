"""The command line: ``beltdyn run SCENE``, ``beltdyn scenes``.

Exit codes: 0 fine, 1 the run failed, 2 bad input, 130 interrupted. A run that fails or is
interrupted still writes what it computed.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

import click

from . import __version__, scenes
from .errors import Interrupted, SimulationError
from .result import Result
from .simulation import METHODS, simulate

__all__ = ["main"]

_FAILED, _BAD_INPUT, _INTERRUPTED = 1, 2, 130
#: What ends a batch job, or a terminal that is closed; Windows has no SIGHUP.
_ENDING = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]


def _stop(message: str, code: int) -> NoReturn:
    click.echo(f"beltdyn: {message}", err=True)
    sys.exit(code)


@contextmanager
def _signals(handler: Any, *which: signal.Signals) -> Iterator[None]:
    before = [(one, signal.signal(one, handler)) for one in which]
    try:
        yield
    finally:
        for one, old in before:
            signal.signal(one, old)


class _Group(click.Group):
    """Says what is wrong in one line, never by a traceback."""

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
            # Standard output is gone or full: nothing more can be said there.
            sys.stdout = open(os.devnull, "w")  # noqa: SIM115
            _stop(f"cannot write: {error.strerror}", _FAILED)
        sys.exit(code if isinstance(code, int) else 0)


@click.group("beltdyn", cls=_Group, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="beltdyn")
def main() -> None:
    """Dynamics of belt drives."""


@main.command("scenes")
def list_scenes() -> None:
    """List the named scenes."""
    width = max(map(len, scenes.names()))
    for name in scenes.names():
        click.echo(f"{name:<{width}}  {scenes.describe(name)}")


@main.command()
@click.argument("scene")
@click.option("--out", type=click.Path(path_type=Path), help="Write the result here (.npz).")
@click.option("--plot", type=click.Path(path_type=Path), help="Write an overview figure here.")
@click.option("--method", type=click.Choice(METHODS), default="auto", show_default=True)
@click.option("--rtol", type=float, default=1e-4, show_default=True, help="Error control.")
@click.option("--t-end", type=float, help="End of the run [s], instead of the scene's.")
@click.option("--quiet", is_flag=True, help="Print nothing but errors.")
def run(
    scene: str,
    out: Path | None,
    plot: Path | None,
    method: str,
    rtol: float,
    t_end: float | None,
    quiet: bool,
) -> None:
    """Run SCENE, a name from `beltdyn scenes` or a TOML file."""
    for path in filter(None, (out, plot)):
        try:
            _check_writable(path)
        except OSError as error:
            _stop(f"cannot write {path}: {error.strerror}", _BAD_INPUT)
    if out is not None and out == plot:
        _stop(f"--out and --plot must not be the same file, {out}", _BAD_INPUT)
    if plot is not None:
        _check_plot(plot)
    try:
        params, torque_fn, scene_t_end = _find(scene)
        # What asks a batch job to end is answered like Ctrl-C.
        with _signals(signal.default_int_handler, *_ENDING):
            result = simulate(
                params,
                torque_fn,
                scene_t_end if t_end is None else t_end,
                method=method,
                rtol=rtol,
                progress=not quiet,
            )
    except OSError as error:
        _stop(f"cannot read {error.filename}: {error.strerror}", _BAD_INPUT)
    except (TypeError, ValueError) as error:
        _stop(str(error), _BAD_INPUT)
    except SimulationError as error:
        _stop(f"{error}{_write(error.result, out, plot)}", _FAILED)
    except Interrupted as error:
        # The finished part is being written: a second Ctrl-C must not lose it.
        with _signals(signal.SIG_IGN, signal.SIGINT, *_ENDING):
            _stop(f"{error}{_write(error.result, out, plot)}", _INTERRUPTED)
    except KeyboardInterrupt:
        _stop("interrupted", _INTERRUPTED)
    written = _write(result, out, plot)
    if not quiet:
        _print_summary(scene, result, written)


def _find(scene: str) -> scenes.Scene:
    if os.path.isdir(scene):
        raise ValueError(f"{scene} is a folder, not a scene")
    if scene.endswith(".toml") or os.path.isfile(scene):
        return scenes.Scene.from_toml(Path(scene))
    return scenes.get(scene)


def _check_writable(path: Path) -> None:
    """Before the run: a run is too dear to find out afterwards."""
    folder = path.parent
    if not folder.is_dir():
        _stop(f"cannot write {path}: there is no folder {folder}", _BAD_INPUT)
    if path.is_dir():
        _stop(f"cannot write {path}: it is a folder", _BAD_INPUT)
    if not os.access(path if path.exists() else folder, os.W_OK):
        _stop(f"cannot write {path}: permission denied", _BAD_INPUT)


def _check_plot(path: Path) -> None:
    try:
        from matplotlib.backend_bases import FigureCanvasBase
    except ImportError:
        _stop(
            "--plot needs matplotlib: python -m pip install matplotlib (or beltdyn[plot])",
            _BAD_INPUT,
        )
    kinds = FigureCanvasBase.get_supported_filetypes()
    if path.suffix[1:].lower() not in kinds:
        _stop(f"cannot plot to {path}: its ending must be one of {', '.join(kinds)}", _BAD_INPUT)


def _write(result: Result | None, out: Path | None, plot: Path | None) -> str:
    """Write what was asked for; say what was written."""
    if result is None or (out is None and plot is None):
        return ""
    written = []
    try:
        if out is not None:
            result.save(out)
            written.append(str(out))
        if plot is not None and result.t.size:
            from .plot import overview

            overview(result).savefig(plot)
            written.append(str(plot))
    except OSError as error:
        path = error.filename or (out if out is not None and not written else plot)
        _stop(f"cannot write {path}: {error.strerror}", _FAILED)
    what = "" if result.success else ", up to there"
    return f"\nwritten{what}: {', '.join(written)}"


def _print_summary(scene: str, result: Result, written: str) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title=scene, show_header=False, title_justify="left")
    for label, value in result.summary():
        table.add_row(label, value)
    Console().print(table)
    if written:
        click.echo(written.strip())
