"""What is measured on the adjusted survey, its covariance, and what it rests on."""
