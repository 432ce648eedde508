"""Studies of many solves: scenes, designs, and finished points stored on disk."""
