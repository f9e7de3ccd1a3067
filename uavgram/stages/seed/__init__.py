"""Stage: where each camera was, before any adjustment, with its covariance."""
