"""Matching of a point of one photo in another, by least squares on image patches."""
