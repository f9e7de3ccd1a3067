"""What could be wrong with a whole photo: turned, in disorder, of another place or camera."""
