"""Sparse Cholesky factors in a good order of elimination, and covariances from them."""
