"""OATH: task assignment and planning for mixed robot fleets among obstacles."""
