"""The YAML that a person writes, parsed into model types: the only place that knows yaml and pydantic."""
