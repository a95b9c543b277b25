"""Reads and writes every format: scenarios, roads, tables, profiles, pages."""
