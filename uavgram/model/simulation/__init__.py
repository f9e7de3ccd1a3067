"""What many simulated repetitions of a survey gave."""
