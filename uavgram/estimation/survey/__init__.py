"""The one likelihood of a survey, its unknowns, and the adjusted survey."""
