"""Our model: autoregressive coarse movement, shaped noise, volatility that varies between drivers and in time."""
