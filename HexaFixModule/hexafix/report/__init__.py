"""Prescription PDF, pictures, tables: from a finished plan document."""
