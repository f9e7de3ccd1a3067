"""What studies ask of simulated surveys, and what they found."""
