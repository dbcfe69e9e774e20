"""`python -m dior` is the command `dior`."""

import sys

from dior.cli.main import main

sys.exit(main())
