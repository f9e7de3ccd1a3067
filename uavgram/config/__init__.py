"""The YAML that a person writes, parsed into model types; only here yaml and pydantic."""
