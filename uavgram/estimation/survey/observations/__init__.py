"""Kinds of observations of the likelihood, each in a file of its own."""
