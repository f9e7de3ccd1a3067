"""The survey in three dimensions and on the earth."""
