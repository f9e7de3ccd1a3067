"""Surveys with known truth, many times over: how good results really are."""
