"""What people observed, and everything that enters the adjustment."""
