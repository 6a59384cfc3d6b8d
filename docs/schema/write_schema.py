"""Write calibration.schema.json beside this file, from the code that reads and writes calibrations.

python docs/schema/write_schema.py
"""

from __future__ import annotations

import json
from pathlib import Path

from tumble.calibration.result import calibration_schema

FILE = Path(__file__).resolve().parent / "calibration.schema.json"


def schema_text() -> str:
    """Return the schema as it is published."""
    head = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$comment": "Written by docs/schema/write_schema.py (make schema); explained in docs/file-format.md.",
    }
    return json.dumps({**head, **calibration_schema()}, indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    FILE.write_text(schema_text(), encoding="utf-8")
