"""Readers and writers of files as model types, one file per format, without computations."""
