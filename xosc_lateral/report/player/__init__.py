"""What the player on a page is given: a played scenario, packed small."""
