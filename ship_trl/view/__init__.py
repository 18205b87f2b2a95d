"""Pictures, films and the window from one painter of scenes; charts of paths and of learning curves."""

import os

# Otherwise pygame prints a greeting when it is imported.
os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
