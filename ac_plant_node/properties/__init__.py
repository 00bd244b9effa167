"""Refrigerant properties as tables."""
