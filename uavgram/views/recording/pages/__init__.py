"""Text pages of the recording: summary, checks, tables, a sheet for each photo."""
