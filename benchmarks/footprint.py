"""Memory of the package against the number of links, and memory and time of its import.

    python benchmarks/footprint.py [--quick] [--write]

Bytes are those allocated from the C library (glibc's mallinfo2), so they repeat exactly.
"Simulation" is the memory of one integration, "result" that of 1001 samples of everything. Peak
memory and import times are of fresh interpreters; CPU time of the whole process, medians of
interleaved repeats, against NumPy alone. Needs Linux.
"""

from __future__ import annotations

import ctypes
import resource
import statistics
import subprocess
import sys

import common
import numpy as np

import beltdyn as bd
from beltdyn import _core

sys.path.insert(0, str(common.HERE.parent / "tests"))
import reference as oracle


class MallInfo(ctypes.Structure):
    _fields_ = [
        (name, ctypes.c_size_t)
        for name in ("arena", "ordblks", "smblks", "hblks", "hblkhd",
                     "usmblks", "fsmblks", "uordblks", "fordblks", "keepcost")
    ]  # fmt: skip


def allocated() -> int:
    """Bytes in use: from the heap and mapped."""
    call = ctypes.CDLL(None).mallinfo2
    call.restype = MallInfo
    info = call()
    return int(info.uordblks + info.hblkhd)


def memory_lines(sizes: tuple[int, ...]) -> list[str]:
    lines = ["links     simulation [kB]   per link [B]   result, 1001 samples [MB]   per link [kB]"]
    for n in sizes:
        scene = common.with_belt(bd.scenes.kubas_case_1(), n_bodies=n)
        # Laid along the belt line, not settled: what it weighs does not depend on where it lies.
        p = scene.params.pulleys
        x, y, phi, _, _ = oracle.belt_line(
            [pulley.center for pulley in p], [pulley.radius for pulley in p], 1.2, n
        )
        state = bd.State(x=x, y=y, phi=phi, theta=np.zeros(len(p)))
        core = state._to_core(scene.params)
        terms = scene.torque_fn.terms()
        before = allocated()
        simulation = _core.Simulation(scene.params._model, core, terms, 1.0)
        held = allocated() - before
        del simulation
        before = allocated()
        result = bd.simulate(
            *scene[:2], 1e-9, initial=state, t_eval=np.linspace(0.0, 1e-9, 1001), ledger=True
        )
        kept = allocated() - before
        del result  # or the next one would be weighed less this one
        lines.append(
            f"{n:5d} {held / 1e3:19.1f} {held / n:14.0f} {kept / 1e6:27.2f} {kept / n / 1e3:15.1f}"
        )
    return lines


#: Appended to what a fresh interpreter runs: its peak memory, by its own account [kB].
PEAK = """
with open("/proc/self/status") as status:
    print(next(line.split()[1] for line in status if line.startswith("VmHWM")))
"""


def fresh(code: str) -> tuple[float, float]:
    """CPU seconds and peak memory [MB] of an interpreter that runs the code."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [sys.executable, "-c", code + PEAK], check=True, capture_output=True, text=True
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return cpu, int(done.stdout) / 1024.0


def main() -> None:
    arguments = common.arguments(__doc__, "half a minute", "10 s")
    repeats = 3 if arguments.quick else 21
    sizes = (60, 240) if arguments.quick else (60, 120, 240, 480, 960, 1920, 3840)
    codes = {
        "nothing": "pass",
        "import numpy": "import numpy",
        "import beltdyn": "import beltdyn",
        "and run case 1": "import beltdyn as bd; bd.simulate(*bd.scenes.kubas_case_1())",
    }
    seconds: dict[str, list[float]] = {name: [] for name in codes}
    peak: dict[str, list[float]] = {name: [] for name in codes}
    for _ in range(repeats):
        for name, code in codes.items():
            cpu, memory = fresh(code)
            seconds[name].append(cpu)
            peak[name].append(memory)
    numpy_alone = statistics.median(seconds["import numpy"])
    lines = [
        "Memory and import",
        *common.machine(),
        "",
        *memory_lines(sizes),
        "",
        f"fresh interpreter (medians of {repeats})   CPU [s]  over NumPy's [s]  peak memory [MB]",
    ]
    for name in codes:
        cpu, memory = statistics.median(seconds[name]), statistics.median(peak[name])
        lines.append(f"{name:34s} {cpu:12.3f} {cpu - numpy_alone:17.3f} {memory:17.1f}")
    common.publish("footprint", lines, arguments.write)


if __name__ == "__main__":
    main()
