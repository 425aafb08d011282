"""``python -m tiltsim``, the same as the console script."""

import sys

from tiltsim.cli import main

sys.exit(main())
