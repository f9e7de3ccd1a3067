"""The recording's view of the scene in three dimensions, and on the earth."""
