"""Which code computes the searches of the learners: versions, BLAS kernel, and the processor's instructions in use.

The simulator has the same bits everywhere; NumPy and BLAS choose their code by the processor, which changes the last
bits of a search. Runs say what they were computed with, and are not continued by something else.
"""

import importlib
from functools import cache
from typing import Any

import numpy as np
from threadpoolctl import threadpool_info  # type: ignore[import-untyped]


@cache
def kernel() -> str:
    """One line, equal where the bits are."""
    blas = sorted(
        f"{entry['internal_api']} {entry.get('version') or '?'} {entry.get('architecture') or '?'}"
        for entry in threadpool_info()
        if entry["user_api"] == "blas" and "numpy" in entry["filepath"]
    )
    features = [name for name in _umath.__cpu_dispatch__ if _umath.__cpu_features__.get(name)]
    return f"numpy {np.__version__}, {', '.join(blas) or 'own linear algebra'}, {' '.join(features) or 'no extensions'}"


_umath: Any = importlib.import_module("numpy._core._multiarray_umath")
ADVICE = "the environment variables OPENBLAS_CORETYPE and NPY_DISABLE_CPU_FEATURES make processors compute alike"
