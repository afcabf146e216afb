"""The flight recorder, read over a link."""

from ivl import native
from ivl.errors import LinkError
from ivl.links.packets import Recording, record_header, record_rows
from ivl.links.tables import Session

MEMORY_RECORDER = 0x18
_TRIES = 3


def download(session: Session, policy_seq: int) -> Recording:
    """Read the recording of the landing that flew a policy.

    Raises:
        LinkError: There is no recorder, it is still recording, or it holds another landing.
    """
    number = session.memory(MEMORY_RECORDER)
    if number is None:
        raise LinkError(f"{session.uri}: the vehicle has no flight recorder (memory 0x18)")
    size = native.library().layout(native.LAYOUT_RECORD_HEADER)[1].itemsize
    row_size = native.library().layout(native.LAYOUT_RECORD_ROW)[1].itemsize
    for _ in range(_TRIES):
        head = session.read_memory(number, 0, size, "flight recorder: header")
        header = record_header(head)
        if not header["frozen"]:
            raise LinkError("flight recorder: it is still recording")
        if header["policy_seq"] not in (0, policy_seq):
            raise LinkError(f"flight recorder: it holds policy {header['policy_seq']}, not {policy_seq}")
        rows = session.read_memory(number, size, int(header["n_rows"]) * row_size, "flight recorder: rows")
        if session.read_memory(number, 0, size, "flight recorder: header") == head:
            return record_rows(header, rows)
    raise LinkError("flight recorder: it kept changing while it was read")
