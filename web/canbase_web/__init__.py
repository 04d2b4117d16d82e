"""`canbase web`: a page in the browser beside a robot. It reads topics; what it orders is one source of the mux."""

import os

# NiceGUI keeps nothing for us. As it is imported it would read `.nicegui` of the current folder, whose owner is
# unknown, and write that back through any link there.
os.environ["NICEGUI_STORAGE_PATH"] = os.devnull
os.environ.pop("NICEGUI_REDIS_URL", None)
