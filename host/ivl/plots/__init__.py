"""Figures, one per file; each `draw` function takes data and paths and returns the files it wrote."""
