"""The ground from above, put together from photos."""
