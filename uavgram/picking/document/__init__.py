"""What has been picked, how it came about, and what each command makes of it. Pure."""
