"""The mission server: runs a mission live, with a console and an API."""
