"""The plant's equations (zones, flows, balances) and their integration in time, compiled."""
