"""The command ``beltdyn sweep``."""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from ..base.optional import optional_module
from ..base.run_warnings import silenced
from ..base.tables import columns, framed
from ..many.outcome import STATUSES
from ..result.exported import write_netcdf
from .command_options import PATH, Asked, option, options
from .ending import BAD_INPUT, FAILED, INTERRUPTED, interruptible, reported, stop
from .written import check_files, write_files

if TYPE_CHECKING:
    from ..sweeping.sweep import Swept

#: Messages of runs without result that are printed.
_SHOWN = 3
#: Pulleys, spans and the like up to which each has a row of the table; runs up to which each has
#: one in place of least, mean and most, if there are no more columns than fit.
_FEW, _COLUMNS = 12, 8


@click.command("sweep")
@click.argument("file", type=PATH)
@options(
    option("out", PATH, "Results (.nc).", required=True),
    option("workers", int, "How many runs at a time; one for each processor."),
    option("scheduler", str, "Address of a Dask scheduler that has the workers."),
    option("store", PATH, "Folder that keeps finished runs; else OUT.runs, until all are done."),
    "quiet",
)
def sweep_scene(asked: Asked) -> None:
    """Run a scene many times with parameters, loads or options changed, as FILE says.

    FILE is TOML: `scene`, a name from `beltdyn scenes`, a file, or a table; `measure`, names of
    quantities; and [over], or [sample] (help(beltdyn.sweeping.file) has an example of each).

    Writes a netCDF file; Python reads it by xarray.open_dataset. Finished runs are kept as they
    come: after Ctrl-C or a kill the same command goes on where it was.
    """
    from ..sweeping import file as sweep_file  # which other commands, and help, do not need
    from ..sweeping.sweep import SweepInterrupted, run_sweep

    if asked.workers is not None and asked.scheduler is not None:
        stop("--workers and --scheduler must not be given together", BAD_INPUT)
    if asked.workers is not None and asked.workers < 1:
        stop(f"--workers must be at least 1, got {asked.workers}", BAD_INPUT)
    check_files(asked, (".nc",))

    def write(dataset: Any) -> None:
        try:
            write_files((asked.out, lambda path: write_netcdf(dataset, path)))
        except ValueError as error:
            stop(f"cannot write {asked.out}: {error}", FAILED)

    folder = asked.store or asked.out.with_name(f"{asked.out.name}.runs")
    begun = time.monotonic()
    with reported("read or write"):
        given = sweep_file.read(asked.file)
        try:
            with interruptible(), silenced():
                swept = run_sweep(
                    **given,
                    executor=_executor(asked.workers, asked.scheduler),
                    store=folder,
                    progress=not asked.quiet,
                )
        except SweepInterrupted as error:
            write(error.dataset)
            stop(f"{error}; written: {asked.out}; go on with the same command", INTERRUPTED)
    write(swept.dataset)
    if asked.store is None:
        shutil.rmtree(folder, ignore_errors=True)
    if not asked.quiet:
        _print(swept, time.monotonic() - begun)
        click.echo(f"written: {asked.out}")
    if not swept.counts.get("finished", 0):
        stop("no run finished; message in the file says why", FAILED)


def _executor(workers: int | None, scheduler: str | None) -> Any:
    if scheduler is None:
        return workers
    distributed = optional_module("distributed", "--scheduler", "cluster")
    try:
        return distributed.Client(scheduler, timeout=10)
    except (OSError, ValueError) as error:
        stop(f"--scheduler {scheduler}: {error}", FAILED)


def _measured(data: Any) -> Iterator[tuple[str, str, str, Any]]:
    """Yield name, pulley or span (if there are few), unit and values in all runs of each number."""
    for key, values in data.data_vars.items():
        unit = values.attrs.get("units", "")
        if values.dtype.kind != "f":
            continue
        own = [dim for dim in values.dims if dim not in data["status"].dims]
        if len(own) != 1 or own[0] not in data.coords or data.sizes[own[0]] > _FEW:
            yield str(key), "", unit, values.values.ravel()
            continue
        for label in data[own[0]].values:
            yield str(key), str(label), unit, values.sel({own[0]: label}).values.ravel()


def _cases(data: Any, over: list[Any], measured: list[Any]) -> list[tuple[str, ...]]:
    """Return a row for each run, of what was changed and measured, below the parts of its names."""
    dims = data["status"].dims
    heads, cells = [], []
    for name in over:
        values = data[name].broadcast_like(data["status"]).transpose(*dims).values.ravel()
        heads.append(str(name).split("."))
        cells.append([f"{one:.6g}" if isinstance(one, float) else str(one) for one in values])
    for name, of, unit, values in measured:
        heads.append([*name.split("."), *filter(None, [of, unit.removesuffix("1")])])
        cells.append(["-" if np.isnan(one) else f"{one:.4g}" for one in values])
    high = max(map(len, heads))
    heads = [[""] * (high - len(one)) + one for one in heads]
    return [*zip(*heads, strict=True), *zip(*cells, strict=True)]


def _ranges(measured: list[Any]) -> Iterator[tuple[str, ...]]:
    """Yield least, mean and most of each quantity, which is named once."""
    before = ""
    for name, of, unit, values in measured:
        known = values[np.isfinite(values)]
        ends = 3 * ["-"]
        if known.size:
            ends = [f"{one:.4g}" for one in (known.min(), known.mean(), known.max())]
        if np.isinf(values).any():  # such as margins of pulleys without a load
            ends[2] = f"inf: {int(np.isinf(values).sum())}"
        yield (*(("", of, "") if name == before else (name, of, unit)), *ends)
        before = name


def _print(swept: Swept, seconds: float) -> None:
    data, measured = swept.dataset, list(_measured(swept.dataset))
    status, dims = data["status"].values.ravel(), set(data["status"].dims)
    over = [name for name in data.coords if data[name].dims and set(data[name].dims) <= dims]
    whole = all(values.size == status.size for *_, values in measured)
    if whole and status.size <= _FEW and len(over) + len(measured) <= _COLUMNS:
        click.echo("\n".join(columns(_cases(data, over, measured))))
    else:
        widest = max((len(name) for name, *_ in measured), default=1)
        heading = ("quantity", "of", "unit", "least", "mean", "most")
        framed("over all runs", _ranges(measured), heading, "<<<>", widest)
    total = sum(swept.counts.values())
    parts = ", ".join(f"{count} {status}" for status, count in swept.counts.items())
    computed = f"{swept.computed} computed by {swept.workers} in {seconds:.3g} s"
    where = [computed] if swept.computed else []
    where += [f"{swept.stored} found in the store"] if swept.stored else []
    warned = sum(bool(one) for one in data["warnings"].values.ravel())
    where += [f"{warned} with warnings (warnings in the file)"] if warned else []
    click.echo(f"{total} runs: {parts}; {', '.join(where)}")
    for bad in STATUSES:
        texts = data["message"].values.ravel()[status == bad]
        if bad == "finished" or not texts.size:
            continue
        for text in list(dict.fromkeys(texts))[:_SHOWN]:
            click.echo(f"  {bad}: {text}")
