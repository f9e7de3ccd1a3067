"""Pipelines from a project file to results: reading, the stages in order, and the outputs."""
