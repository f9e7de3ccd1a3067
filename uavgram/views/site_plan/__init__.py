"""Plan of the survey, drawn to scale on the ground as the photos show it."""
