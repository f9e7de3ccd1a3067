"""Many repetitions of one survey: how good they were, and a batch of them at once."""
