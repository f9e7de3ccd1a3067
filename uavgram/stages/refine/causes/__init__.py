"""Causes of misfits: hypotheses on mistakes, tested at the stated noise."""
