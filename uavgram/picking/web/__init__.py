"""The page's server: who may come in, what is served."""
