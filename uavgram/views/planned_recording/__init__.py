"""Recording of a plan for the Rerun viewer."""
