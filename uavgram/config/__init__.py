"""Parser of YAML input files into model types, the only place that uses yaml and pydantic."""
