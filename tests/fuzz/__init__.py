"""The project's fuzzer: sound files of every kind, changed at random and read; every outcome is a result or a sentence.

    python -m tests.fuzz --cases 20000

A case is told by its number alone: seeds, mutations and outcome are the same on every machine. What was found once
stands in ``found.json``, as small as it could be made, and is read by the tests for ever.
"""

import sys
from pathlib import Path

# From where tests of other rooms import one another; pytest has it in its path.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
