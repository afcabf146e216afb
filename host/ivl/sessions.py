"""Sessions of a run that is flown in a room: what is another one since the last session is told, and flying goes on.

A simulated run that is continued equals an uninterrupted one bit for bit, so nothing may change there. What a vehicle
in a room has flown nobody can repeat bit for bit, whatever has changed.
"""

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from ivl.errors import StoreError

_TOLD = {
    "uri": "the link was {old}, and is {new}",
    "vehicle": "the vehicle was {old}, and is {new}",
    "library_sha256": "the native library is another one: it was rebuilt",
    "model_sha256": "vehicle or gear files of the simulator that judges have changed",
    "ivl_version": "ivl was version {old}, and is {new}",
    "numerics": "the learner computes with {new}, before with {old}",
}
"""What may be another one in a later session, and what is then said."""


def session_of(manifest: Mapping[str, Any], vehicle: str) -> dict[str, Any]:
    """What is kept of a session: of the manifest that a run would have that began now, and which vehicle flies."""
    kept = {name: manifest[name] for name in _TOLD if name != "vehicle"}
    return {"utc": datetime.now(UTC).isoformat(timespec="seconds"), **kept, "vehicle": vehicle}


def changes(before: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """What is another one, a line each; a vehicle that does not say which it is is none that has changed."""
    return [
        text.format(old=before[name], new=now[name])
        for name, text in _TOLD.items()
        if before[name] != now[name] and not (name == "vehicle" and not (before[name] and now[name]))
    ]


def go_on(old: Mapping[str, Any], session: Mapping[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """The manifest of a run with a further session, and what is another one since the last."""
    told = changes(old["sessions"][-1], session)
    return {**old, "sessions": [*old["sessions"], dict(session)]}, told


def refuse_without_link(folder: object, old: Mapping[str, Any]) -> None:
    """Refuse to go on in the simulator where a vehicle has flown; before anything that takes long.

    Raises:
        StoreError: A vehicle has flown, and none is named.
    """
    if old.get("flown"):
        words = "--rehearse" if old.get("rehearsed") else "--uri site"
        raise StoreError(f"{folder}: cannot be resumed without its vehicle: add {words}")


def refuse_other_kind(folder: object, old: Mapping[str, Any], new: Mapping[str, Any]) -> None:
    """Refuse to go on with a drone where a day was rehearsed, or in a simulator where a vehicle flew; and conversely.

    Raises:
        StoreError: It is another kind of run.
    """
    for name, words in (("flown", "flown in a room"), ("rehearsed", "a rehearsal")):
        was, is_now = bool(old.get(name)), bool(new.get(name))
        if was != is_now:
            kind = [words if value else f"not {words}" for value in (was, is_now)]
            raise StoreError(f"{folder}: cannot be resumed: it is {kind[0]}, and now would be {kind[1]}")
