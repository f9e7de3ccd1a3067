"""A plan to look at in the Rerun viewer."""
