"""Reports: one HTML page per run that is looked at without network, server or this package."""

from ivl.report.build import Report, write

__all__ = ["Report", "write"]
