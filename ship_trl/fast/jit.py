"""Loops compiled by numba."""

from __future__ import annotations

import hashlib
import shutil
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import FunctionCache, IndexDataCacheFile

Loop = Callable[..., Any]

# The last bit may be rounded differently (fused multiply-add), and zeros have no sign.
RELAXED = {"contract", "nsz"}
# Lets the compiler assume that no value is NaN, so that `min` and `max` are single instructions.
NO_NAN = RELAXED | {"nnan"}
PACKAGE = Path(__file__).parent.parent
# All files with loops, and what they import: numba inlines their functions and constants.
INLINED = ("fast/*.py", "config/*.py", "files/*.py", "sim/*.py", "policies/sb_mpc.py")
# Seconds. A younger folder may belong to a process that runs.
STALE = 24 * 3600


def digest() -> str:
    """Return 16 hexadecimal digits of numba's version and the text of all files that loops inline."""
    found = hashlib.sha256(numba.__version__.encode())
    for path in sorted({path for pattern in INLINED for path in PACKAGE.glob(pattern)}):
        found.update(f"\n{path.relative_to(PACKAGE)}\n".encode() + path.read_bytes())
    return found.hexdigest()[:16]


PREFIX = "ship_trl-"
FOLDER = PREFIX + digest()


@cache
def announce() -> None:
    """Say on a terminal, once a process, why nothing seems to happen."""
    if sys.stderr.isatty():
        sys.stderr.write("compiling loops, which takes up to a minute, once for this version of the code\n")


class LoopCache(FunctionCache):
    """numba's cache of a function, in a folder for the package's present text; what cannot be read is a miss.

    numba itself notices a change of the function's own file only.
    """

    def __init__(self, function: Loop) -> None:
        super().__init__(function)
        self._cache_path = str(Path(self._cache_path) / FOLDER)
        stamp = self._impl.locator.get_source_stamp()
        self._cache_file = IndexDataCacheFile(self._cache_path, self._impl.filename_base, stamp)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Load the compiled function of a signature; return None if there is none that can be read."""
        if not Path(self._cache_path).is_dir():
            announce()
        try:
            found = super().load_overload(sig, target_context)
        except Exception:  # what is in a cut file may raise anything
            with suppress(OSError):
                self.flush()
            return None
        # Of two processes that store two signatures at once, one may have written over the other's file.
        return found if found is not None and tuple(found.signature.args) == tuple(sig) else None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Store a compiled function, if the disk lets it; a new folder replaces those of earlier texts."""
        folder = Path(self._cache_path)
        with suppress(OSError):
            if not folder.is_dir():
                for other in folder.parent.glob(f"{PREFIX}*"):
                    if time.time() - other.stat().st_mtime > STALE:
                        shutil.rmtree(other, ignore_errors=True)
                folder.mkdir(parents=True, exist_ok=True)
            super().save_overload(sig, data)


def compiled(fastmath: set[str] | bool = False) -> Callable[[Loop], Loop]:
    """Compile a function at its first call, and cache the result for later processes if a folder is writable.

    Division by zero behaves as in NumPy, because a check would prevent vectorised loops. `fastmath` names
    LLVM's flags that relax rounding.
    """

    def decorate(function: Loop) -> Loop:
        loop: Any = numba.njit(fastmath=fastmath, error_model="numpy")(function)
        with suppress(RuntimeError):  # no writable folder for a cache
            loop._cache = LoopCache(function)  # noqa: SLF001
        return loop

    return decorate
