"""Whether the limits of this process let the package be loaded; looked at when this module is loaded, the first of all.

It needs nothing but Python itself. With too little address space numpy and its friends fail in many ways while they are
loaded: some raise, some crash, some wait for ever.
"""

import resource
import sys
from pathlib import Path

NEEDED_BYTES = 350_000_000
"""Of address space, to load the package and list what there is; with 300 MB that was seen to work."""
TIGHT_BYTES = 2_000_000_000
"""Below this, what some commands load later may not find room."""
_LIMITS = ((resource.RLIMIT_AS, "address space", "ulimit -v"), (resource.RLIMIT_DATA, "data", "ulimit -d"))


def complaint(needed_bytes: int = NEEDED_BYTES) -> str | None:
    """What limit is below this, and what to do; None if none is."""
    for number, what, command in _LIMITS:
        limit = resource.getrlimit(number)[0]
        if limit != resource.RLIM_INFINITY and limit < needed_bytes:
            return (
                f"this process may have {limit // 1_000_000} MB of {what}, and {needed_bytes // 1_000_000} MB are "
                f"needed: raise the limit in this shell (`{command} unlimited`), or ask whoever has set it"
            )
    return None


def explain(error: Exception) -> str | None:
    """What to say of an error that libraries raise when they find no room to be loaded; None if there is room."""
    text = complaint(TIGHT_BYTES)
    return None if text is None else f"{type(error).__name__}: {error}; {text}"


def require() -> None:
    """End the program `ivl` with one line if a limit is too low.

    Raises:
        SystemExit: In the program; exit code 2.
        MemoryError: In somebody else's program.
    """
    text = complaint()
    if text is None:
        return
    if Path(sys.argv[0]).name == "ivl" or sys.orig_argv[1:3] == ["-m", "ivl"]:
        sys.stderr.write(f"ivl: {text}\n")
        raise SystemExit(2)
    raise MemoryError(text)


require()
