"""Kinds of known things, by how they are computed."""
