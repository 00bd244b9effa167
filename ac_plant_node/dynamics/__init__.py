"""The moving-boundary model: zones, balances, integration."""
