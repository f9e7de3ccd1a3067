"""Model types turned into something to look at; computes nothing."""
