"""Work on many items at once: by processes of this machine that stay, or by a cluster's workers."""
