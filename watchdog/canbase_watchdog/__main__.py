"""`python -m canbase_watchdog`."""

import sys

from canbase_watchdog.main import main

sys.exit(main())
