"""Named studies: grids of simulations, and their results."""
