"""What happens in a scenario: storyboard, road, player, motion, surroundings."""
