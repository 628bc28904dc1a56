"""The workspace, the roadmap through it, and what travel on it costs."""
