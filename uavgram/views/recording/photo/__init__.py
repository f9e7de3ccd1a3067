"""View of one photo in the recording, and its overlay."""
