"""The recording's pages of text: summary, checks, tables, a sheet for each photo."""
