"""How a command ends: exit codes, errors in one line, signals, warnings."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NoReturn

import click

from ..base.run_warnings import RunWarning

FAILED, BAD_INPUT, INTERRUPTED = 1, 2, 130
#: Signals sent by batch systems and closed terminals; Windows has no SIGHUP.
_ENDING = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]


def stop(message: str, code: int) -> NoReturn:
    """End with a line on stderr and this exit code."""
    click.echo(f"beltdyn: {message}", err=True)
    sys.exit(code)


def warn(noticed: Iterable[RunWarning], quiet: bool) -> None:
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
def interruptible() -> Iterator[None]:
    """Treat the signals that end a batch job like Ctrl-C, and answer only the first."""
    before = [(one, signal.signal(one, _interrupt_once)) for one in (signal.SIGINT, *_ENDING)]
    try:
        yield
    finally:
        for one, old in before:
            if signal.getsignal(one) is _interrupt_once:  # not so once a signal was answered
                signal.signal(one, old)


@contextmanager
def reported(access: str = "read", kept: Callable[[], str] = lambda: "") -> Iterator[None]:
    """Stop with one line, and the exit code of its kind, at what a scene or its run may raise."""
    try:
        yield
    except OSError as error:
        code = FAILED if access == "write" else BAD_INPUT
        stop(f"cannot {access} {error.filename}: {error.strerror or error}", code)
    except (TypeError, ValueError, ImportError) as error:
        stop(str(error), BAD_INPUT)
    except RuntimeError as error:  # of runs, and of workers that are lost
        stop(str(error), FAILED)
    except KeyboardInterrupt as error:
        stop(f"{str(error) or 'interrupted'}{kept()}", INTERRUPTED)


class Group(click.Group):
    """Reports errors in one line, never as a traceback."""

    def main(self, args: Sequence[str] | None = None, *more: Any, **options: Any) -> Any:
        """Run the command and exit; what commands leave to this is said here, too."""
        try:
            code = super().main(args, *more, **(options | {"standalone_mode": False}))
        except click.exceptions.NoArgsIsHelpError as error:
            click.echo(error.format_message())
            sys.exit(0)
        except click.ClickException as error:
            hint, text = "", error.format_message().rstrip(".")
            if isinstance(error, click.UsageError):
                words = sys.argv[1:] if args is None else args
                name = next((f" {one}" for one in words if one in self.commands), "")
                path = error.ctx.command_path if error.ctx else f"{self.name}{name}"
                hint = f" (try: {path} --help)"
            if likely := getattr(error, "possibilities", None):  # in the order of their likeness
                text = f"{error.message.rstrip('.')} (did you mean {likely[0]!r}?)"
            stop(f"{text}{hint}", BAD_INPUT)
        except click.Abort:
            stop("interrupted", INTERRUPTED)
        except MemoryError as error:
            stop(str(error) or "out of memory", FAILED)
        except OSError as error:
            # Standard output is closed or full: nothing more can be printed there.
            sys.stdout = open(os.devnull, "w")  # noqa: SIM115
            stop(f"cannot write: {error.strerror}", FAILED)
        sys.exit(code if isinstance(code, int) else 0)
