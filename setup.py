"""Builds the C core. Everything else stands in pyproject.toml.

The core is plain C11. On x86-64 its inner loops (``csrc/kernels/*_avx*.c``) are compiled once per
instruction level, each file with flags of its own, and the level is chosen when a model is made;
nothing is built for the machine that happens to build it.

``BELTDYN_STRICT=1`` turns warnings on and into errors (used by ``.ci/run``). ``BELTDYN_DEBUG=1``
keeps debug information, ten times as large as the code, without which a build takes two thirds of
the time, and has every step of a run checked that otherwise its end is
(``csrc/run/invariants.c``).
"""

from __future__ import annotations

import hashlib
import os
import platform
import sysconfig
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy
from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext
from setuptools.modified import newer_group

CORE = Path("csrc")
# No -ffast-math: only what changes no result but errno and flags. Nothing is fused but where the
# kernels say so (csrc/kernels/vector.h): results do not depend on how a compiler reads the code.
FLAGS = [
    "-std=c11",
    "-O3",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-ffp-contract=off",
    "-fvisibility=hidden",
    "-fno-wrapv",  # Python builds with -fwrapv, which hides from the compiler how far loops run
]
STRICT = ["-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror"]
AVX2 = ["-mavx2", "-mfma"]
AVX512 = ["-mavx512f", "-mavx512dq", "-mavx512vl", "-mfma", "-mprefer-vector-width=512"]
DEBUG = bool(os.environ.get("BELTDYN_DEBUG"))
X86 = platform.machine().lower() in {"x86_64", "amd64"} and "arm64" not in os.environ.get(
    "ARCHFLAGS", ""
)
# Processors without AVX2 were last sold in 2013. For them the kernels take half the time to compile
# and are some 15 % slower than at -O3; their results have the same bits.
OF_LEVEL = {"baseline": ["-O1"], "avx2": AVX2, "avx512": AVX512} if X86 else {"baseline": []}
LEVELS = {p: flags for level, flags in OF_LEVEL.items() for p in CORE.glob(f"kernels/*_{level}.c")}
OTHERS = {*CORE.glob("examples/*"), *CORE.glob("kernels/*_avx*.c")} - LEVELS.keys()
SOURCES = sorted({*CORE.glob("*/*.c")} - OTHERS)


class BuildCore(build_ext):
    """Compiles files side by side, each kernel level with its own flags, and links them.

    Nine tenths of the time goes into the kernels, each of which has every friction law on every
    belt and contact; they begin, and two processors are busy to the end. -O2 would save a tenth of
    it and make some runs take half as long again (gcc 12): all else has -O3.
    """

    def build_extension(self, ext: Extension) -> None:
        # Objects are kept, in a folder for each way to compile. Where headers lie, which changes
        # with each of pip's environments, is none of it, nor are warnings: a strict build compiles
        # every file, and what it made serves the others.
        way = repr((self.compiler.compiler_so, flags, numpy.__version__))
        folder = str(Path(self.build_temp) / hashlib.sha256(way.encode()).hexdigest()[:12])

        def compiled(source: str) -> list[str]:
            known = self.compiler.object_filenames([source], output_dir=folder)
            if not (self.force or strict or newer_group([source, *ext.depends], known[0])):
                return known
            return self.compiler.compile(
                [source],
                output_dir=folder,
                macros=ext.define_macros,
                include_dirs=ext.include_dirs,
                extra_postargs=[*ext.extra_compile_args, *LEVELS.get(Path(source), [])],
                depends=ext.depends,
            )

        order = sorted(ext.sources, key=lambda source: Path(source).parent.name != "kernels")
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            for objects in pool.map(compiled, order):
                ext.extra_objects += objects
        ext.sources = []
        self.force = True  # to link, which takes a second: what lies there may be of another way
        super().build_extension(ext)


flags = list(FLAGS)
if not DEBUG:
    flags.append("-g0")  # Python's own flags have -g
strict = []
if os.environ.get("BELTDYN_STRICT"):
    # -isystem: other people's headers are not ours to mend
    strict = [
        *STRICT,
        f"-isystem{numpy.get_include()}",
        f"-isystem{sysconfig.get_path('include')}",
    ]

setup(
    ext_modules=[
        Extension(
            "beltdyn._core",
            sources=[str(p) for p in SOURCES],
            depends=["setup.py", *sorted(str(p) for p in CORE.rglob("*.h"))],
            include_dirs=[str(CORE), numpy.get_include()],
            define_macros=[
                ("NPY_NO_DEPRECATED_API", "NPY_1_7_API_VERSION"),
                *([("BD_X86_LEVELS", "1")] if X86 else []),
                *([("BD_CHECK_STEPS", "1")] if DEBUG else []),
            ],
            extra_compile_args=[*flags, *strict],
        )
    ],
    cmdclass={"build_ext": BuildCore},
)
