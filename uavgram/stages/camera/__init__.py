"""A camera from what photos say of it, and what a survey teaches of its camera."""
