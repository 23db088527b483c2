"""`inside/` belongs to the Blender processes that test_extension.py starts, not to the run that starts them."""

import os

collect_ignore = [] if "GSSMC_ZIP" in os.environ else ["inside"]
