"""One painter of scenes, for pictures, films and the window; charts of paths and of learning."""

import os

# pygame greets on standard output when it is imported; a library must not.
os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
