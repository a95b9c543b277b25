"""A room for every verb: its call, its work, its page."""
