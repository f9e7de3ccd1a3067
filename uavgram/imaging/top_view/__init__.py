"""The ground seen from straight above, put together from photos."""
