"""Reports: one HTML page per run or policy that is looked at without network, server or this package."""

from ivl.report.build import Report, write, write_policy

__all__ = ["Report", "write", "write_policy"]
