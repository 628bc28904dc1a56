"""Settings of the whole suite."""

from __future__ import annotations

import os

from hypothesis import settings

# Where nobody can look into a failure, every run tries the same examples; elsewhere new ones.
settings.register_profile("ci", derandomize=True, deadline=None)
if os.environ.get("CI"):
    settings.load_profile("ci")
