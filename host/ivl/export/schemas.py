"""JSON schemas of the messages in an MCAP file, built from small parts.

Foxglove recognises its own messages by the name of the schema; the schema itself tells every other reader (PlotJuggler,
a script) what is inside. They describe what `scene` writes, in the fields and types of Foxglove's definitions.
"""

import json
from collections.abc import Iterable
from typing import Any

Schema = dict[str, Any]

_NUMBER: Schema = {"type": "number"}
_TEXT: Schema = {"type": "string"}
_BOOL: Schema = {"type": "boolean"}
_INTEGER: Schema = {"type": "integer"}


def _object(**properties: Schema) -> Schema:
    return {"type": "object", "properties": properties}


def _list(items: Schema) -> Schema:
    return {"type": "array", "items": items}


_TIME = _object(sec={"type": "integer", "minimum": 0}, nsec={"type": "integer", "minimum": 0, "maximum": 999_999_999})
_VECTOR = _object(x=_NUMBER, y=_NUMBER, z=_NUMBER)
_QUATERNION = _object(x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
_POSE = _object(position=_VECTOR, orientation=_QUATERNION)
_COLOUR = _object(r=_NUMBER, g=_NUMBER, b=_NUMBER, a=_NUMBER)
_BOX = {"pose": _POSE, "size": _VECTOR, "color": _COLOUR}
_LINE = _object(
    type=_INTEGER,
    pose=_POSE,
    thickness=_NUMBER,
    scale_invariant=_BOOL,
    points=_list(_VECTOR),
    color=_COLOUR,
    colors=_list(_COLOUR),
    indices=_list(_INTEGER),
)
_ENTITY = _object(
    timestamp=_TIME,
    frame_id=_TEXT,
    id=_TEXT,
    lifetime=_TIME,
    frame_locked=_BOOL,
    metadata=_list(_object(key=_TEXT, value=_TEXT)),
    arrows=_list(_object()),
    cubes=_list(_object(**_BOX)),
    spheres=_list(_object(**_BOX)),
    cylinders=_list(_object(**_BOX, bottom_scale=_NUMBER, top_scale=_NUMBER)),
    lines=_list(_LINE),
    triangles=_list(_object()),
    texts=_list(_object()),
    models=_list(_object()),
)
_TRANSFORM = _object(
    timestamp=_TIME, parent_frame_id=_TEXT, child_frame_id=_TEXT, translation=_VECTOR, rotation=_QUATERNION
)

FRAME_TRANSFORMS = "foxglove.FrameTransforms"
POSE_IN_FRAME = "foxglove.PoseInFrame"
SCENE_UPDATE = "foxglove.SceneUpdate"
STATE = "ivl.State"

_FOXGLOVE: dict[str, Schema] = {
    FRAME_TRANSFORMS: _object(transforms=_list(_TRANSFORM)),
    POSE_IN_FRAME: _object(timestamp=_TIME, frame_id=_TEXT, pose=_POSE),
    SCENE_UPDATE: _object(deletions=_list(_object(timestamp=_TIME, type=_INTEGER, id=_TEXT)), entities=_list(_ENTITY)),
}


def text(name: str, columns: Iterable[str] = ()) -> bytes:
    """A schema as it is stored; `columns` are the numbers of an `ivl.State`."""
    if name == STATE:
        numbers = {column: {"type": ["number", "null"]} for column in columns}
        schema = _object(**numbers, phase_name=_TEXT)
    else:
        schema = _FOXGLOVE[name]
    return json.dumps({"title": name, **schema}).encode()
