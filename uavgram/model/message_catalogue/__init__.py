"""Catalogue of all messages: meaning, order, and effect on the verdict."""
