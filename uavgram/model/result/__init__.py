"""Results of a run, as frozen, batched data."""
