"""Parallel work on many items: by long-lived local processes, or by the workers of a cluster."""
