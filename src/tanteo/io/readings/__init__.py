"""Readers of measured readings: tables, logs, bags and marks."""
