"""Where adjustments begin: first values, and what leads from them."""
