"""A result in Python and in notebooks: tables of pandas, plots of matplotlib, and its display."""
