"""Build of the compiled loops: everything else about the package stands in pyproject.toml.

Every `kernels.py` is Python that Cython translates to C. On x86-64 with Linux each loop is made thrice, for any such
processor and for those of the levels v3 (AVX2, FMA) and v4 (AVX-512), and the loader takes the one that the machine
has. What was built is kept by the hash of all that went into it, so that another checkout of the same sources builds
in a second.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import threading
from pathlib import Path

import Cython
from Cython.Build import cythonize
from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

SOURCES = [
    "src/tumble/attitude/kernels.py",
    "src/tumble/estimation/kernels.py",
    "src/tumble/navigation/kernels.py",
    "src/tumble/navigation/filter/kernels.py",
    "src/tumble/noise/kernels.py",
    "src/tumble/recording/formats/kernels.py",
    "src/tumble/segmentation/kernels.py",
    "src/tumble/sensor/kernels.py",
    "src/tumble/simulation/kernels.py",
]
# One translation at a time; the compiler runs for several.
TRANSLATING = threading.Lock()
# What reads arrays, for all of them.
SHARED = "tumble._memoryviews"
# Indices are right by construction, and a division by zero is infinite.
DIRECTIVES = {
    "boundscheck": False,
    "wraparound": False,
    "cdivision": True,
    "initializedcheck": False,
    "infer_types": True,
}
# Sums may be added in any order where only their total is wanted; what is not a number stays so.
ANY_ORDER = ["-fassociative-math", "-fno-signed-zeros", "-fno-trapping-math", "-fno-math-errno"]
# A seed gives the same digits on every machine, and an attitude less itself is nothing.
EXACT = ["-ffp-contract=off"]
FLAGS = {
    "src/tumble/noise/kernels.py": ANY_ORDER,
    "src/tumble/navigation/filter/kernels.py": ANY_ORDER,
    "src/tumble/simulation/kernels.py": EXACT,
}
# A wheel's tag -> what the package index's compiler calls the machine. `make wheels` asks for each of them.
TARGETS = {
    "manylinux_2_28_x86_64": "x86_64-linux-gnu.2.28",
    "manylinux_2_28_aarch64": "aarch64-linux-gnu.2.28",
    "macosx_11_0_x86_64": "x86_64-macos.11.0",
    "macosx_11_0_arm64": "aarch64-macos.11.0",
}
WHEEL = os.environ.get("TUMBLE_WHEEL", "")
# Such a wheel is for every Python from this one on.
OLDEST = ("cp311", "0x030B0000")
LEVELS = """
#if defined(__x86_64__) && defined(__linux__) && defined(__GLIBC__)
#define TUMBLE_LEVELS __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define TUMBLE_LEVELS
#endif
#if defined(__GNUC__)
#define TUMBLE_INLINE inline __attribute__((always_inline))
#else
#define TUMBLE_INLINE CYTHON_INLINE
#endif
"""


def flags(source: str, compiler: str) -> list[str]:
    """Return the compiler's arguments for a source."""
    if compiler == "msvc":
        return ["/O2"]
    if not source:
        return ["-O1", "-g0"]
    return ["-O3", "-g0", "-fno-math-errno", "-Wno-maybe-uninitialized", *FLAGS.get(source, [])]


class BuildKernels(build_ext):
    """Compile what has changed, with the package index's compiler where the machine has none."""

    def run(self) -> None:
        """Compile, and write down from what: the tests hold the sources against it."""
        super().run()
        if self.inplace:
            parts = ["setup.py", *SOURCES, *_declarations()]
            lines = [f"{hashlib.sha256(Path(p).read_bytes()).hexdigest()}  {p}\n" for p in parts]
            Path("build").mkdir(exist_ok=True)
            Path("build/kernels.sha256").write_text("".join(lines), encoding="utf-8")

    def build_extensions(self) -> None:
        """Compile all, each from what is kept if nothing that goes into it has changed."""
        unix = self.compiler.compiler_type == "unix"
        if WHEEL or (unix and not shutil.which(self.compiler.compiler_so[0])):
            zig = [sys.executable, "-m", "ziglang", "cc"]
            zig += ["-target", TARGETS[WHEEL]] if WHEEL else []
            # Whatever loads the module on macOS is the Python that it looks for.
            late = ["-undefined", "dynamic_lookup"] if WHEEL.startswith("macosx") else []
            self.compiler.set_executables(
                compiler_so=[*zig, "-O3", "-fwrapv", "-fPIC", "-DNDEBUG"], linker_so=[*zig, "-shared", *late]
            )
        self.parallel = os.cpu_count()
        super().build_extensions()

    def build_extension(self, extension: Extension) -> None:
        """Compile one, or take it from what is kept."""
        source = extension.sources[0] if extension.sources else ""
        target = Path(self.get_ext_fullpath(extension.name))
        kept = _kept(source, " ".join(self.compiler.compiler_so))
        if not kept.exists():
            extension.extra_compile_args = flags(source, self.compiler.compiler_type)
            with TRANSLATING:
                extension.sources = [_translated(extension) if source else _shared()]
            super().build_extension(extension)
            kept.parent.mkdir(parents=True, exist_ok=True)
            _copy(target, kept)
        target.parent.mkdir(parents=True, exist_ok=True)
        _copy(kept, target)


def _shared() -> str:
    """Return the C file of what all of them need to read arrays: made once instead of once in each."""
    path = Path("build/c") / f"{SHARED.rpartition('.')[2]}.c"
    path.parent.mkdir(parents=True, exist_ok=True)
    subprocess.run([sys.executable, "-m", "cython", f"--generate-shared={path}"], check=True)
    return str(path)


def _translated(extension: Extension) -> str:
    """Return the C file of a source, its loops marked to be made for several processors."""
    (made,) = cythonize(
        [extension],
        build_dir="build/c",
        compiler_directives=DIRECTIVES,
        include_path=["src"],
        quiet=True,
        force=True,
        shared_utility_qualified_name=SHARED,
    )
    path = Path(made.sources[0])
    marked = re.sub(
        r"^static (PyObject \*__pyx_pf_|(?!CYTHON_INLINE)\w+ __pyx_f_)",
        r"TUMBLE_LEVELS static \1",
        path.read_text(encoding="utf-8"),
        flags=re.MULTILINE,
    )
    # A helper is compiled in the loop that calls it, for the processor that this is compiled for.
    marked = re.sub(
        r"^static CYTHON_INLINE (\w+ __pyx_f_)", r"static TUMBLE_INLINE \1", marked, flags=re.MULTILINE
    )
    # after Python.h, which says what the C library is
    path.write_text(
        marked.replace('#include "Python.h"\n', f'#include "Python.h"\n{LEVELS}', 1), encoding="utf-8"
    )
    return str(path)


def _kept(source: str, compiler: str) -> Path:
    """Return where the compiled form of a source is kept."""
    parts = [__file__, *([source, *_declarations()] if source else [])]
    said = [Cython.__version__, sysconfig.get_config_var("EXT_SUFFIX"), compiler, sysconfig.get_platform()]
    digest = hashlib.sha256("\n".join(said).encode())
    for part in parts:
        digest.update(Path(part).read_bytes())
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return home / "tumble" / "kernels" / f"{digest.hexdigest()[:32]}.bin"


def _declarations() -> list[str]:
    """Return the files by which compiled modules know one another, and the constants that they take."""
    return sorted(str(path) for path in Path("src").rglob("*.pxd"))


def _copy(source: Path, target: Path) -> None:
    """Copy in one step: a program that has the old one loaded keeps it."""
    if source.resolve() == target.resolve():
        return
    made = target.with_name(f"{target.name}.{os.getpid()}.part")
    shutil.copyfile(source, made)
    made.chmod(0o755)
    made.replace(target)


def _extension(name: str, sources: list[str]) -> Extension:
    """Return a module to build: for this Python, or of a wheel for all of them."""
    macros = [("Py_LIMITED_API", OLDEST[1])] if WHEEL else []
    return Extension(name, sources, define_macros=macros, py_limited_api=bool(WHEEL))


setup(
    ext_modules=[
        _extension(SHARED, []),
        *(
            _extension(name.removeprefix("src/").removesuffix(".py").replace("/", "."), [name])
            for name in SOURCES
        ),
    ],
    cmdclass={"build_ext": BuildKernels},
    options={
        "bdist_wheel": {"plat_name": WHEEL, "py_limited_api": OLDEST[0]},
        "build": {"build_base": f"build/{WHEEL}"},
    }
    if WHEEL
    else {},
)
