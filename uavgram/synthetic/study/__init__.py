"""Named studies: grids of simulations, and what they show."""
