"""What surrounds a vehicle: its neighbours, and the context that its driver sees."""
