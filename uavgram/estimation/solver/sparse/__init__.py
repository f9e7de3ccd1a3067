"""Sparse Cholesky factorisation with fill-reducing elimination order, and covariances from it."""
