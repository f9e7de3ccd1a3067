"""The page to take to the field: what to lay, what to fly, and what will then be known."""
