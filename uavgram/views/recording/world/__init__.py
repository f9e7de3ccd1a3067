"""View of the scene in three dimensions, and on the earth, in the recording."""
