"""Cut-in alarms and verdicts under lifelike movement, on the public ALKS scenarios."""
