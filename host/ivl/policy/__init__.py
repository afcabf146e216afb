"""Policies for every approach: learned over random approaches, kept in a file, judged on fresh ones.

experiment -> map of thresholds and moments -> search with a learner -> go / no-go -> policy file -> assessment
"""
