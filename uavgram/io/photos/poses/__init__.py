"""Where each photo was taken, as photos, image logs and tables state it."""
