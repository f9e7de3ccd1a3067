"""Values measured on the adjusted survey, their covariance, and which errors make it."""
