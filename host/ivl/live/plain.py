"""Numbers as JSON has them: what is not finite is null."""

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np


def plain(value: Any) -> Any:
    """The value as plain data; arrays become lists, and numbers that are not finite None."""
    if isinstance(value, Mapping):
        return {str(name): plain(part) for name, part in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(part) for part in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def text(value: Any) -> str:
    """The value as JSON."""
    return json.dumps(plain(value), separators=(",", ":"), allow_nan=False)
