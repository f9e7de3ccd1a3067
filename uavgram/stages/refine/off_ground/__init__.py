"""The search for points that stand off the ground though nobody said so."""
