"""Queries of pages, commands and steps of the flow, by subject; each takes an open store."""
