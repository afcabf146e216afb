"""A policy for every approach whose numbers are known, and what it is flown on."""

from ivl.policy import file
from ivl.policy.file import PolicyFile
from ivl.policy.flying import PolicyTask
from ivl.policy.shape import General

TASK = PolicyTask(
    vehicle="habas2021", gear="wide_short", gear_set="as_simulated", estimator="known_height_predicted", start="flown"
)


def good_theta() -> list[float]:
    """Numbers that land in all of the box, and refuse slow approaches."""
    shape = General("polynomial2")
    theta = shape.level(5.082, 10.0)
    theta[shape.threshold] = [5.082, 0.253, 1.408, -0.208, 0.379, -0.922]
    theta[shape.go_p_min] = 0.5
    theta[shape.go] = [5.0, 4.0, 8.0] + [0.0] * 7
    return theta.tolist()


def by_hand() -> PolicyFile:
    """That policy, as somebody would write it into a file."""
    return file.make(General("polynomial2").form, good_theta(), [TASK], None, None)
