"""Sparse Cholesky factorisation with a good order, and the covariances that are asked for."""
