"""Everything that a run computed, as frozen, batched data."""
