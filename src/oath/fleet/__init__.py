"""Actions to robots, robots to events."""
