"""Copies of photos with other tags; their pixels are copied byte by byte."""
