"""Position and attitude of each photo from tags, image logs and tables."""
