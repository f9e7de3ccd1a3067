"""From a scenario to a plan: flights to choose from, reference lines, and what they will reach."""
