"""Views of simulated surveys."""
