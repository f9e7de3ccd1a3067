"""A camera from a file, from what photos say of it, or from photos of a calibration board."""
