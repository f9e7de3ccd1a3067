"""Kinds of known things, grouped by how their residuals are computed."""
