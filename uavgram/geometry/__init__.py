"""Geometric kernels on plain arrays with analytic Jacobians; NaN marks undefined results."""
