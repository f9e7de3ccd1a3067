"""Pure kernels on plain arrays, with analytic Jacobians; NaN marks what has no answer."""
