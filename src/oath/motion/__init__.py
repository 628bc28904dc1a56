"""From a route and the mission's rules to a path on the roadmap."""
