"""Write the JSON schemas beside this file, from the code that reads and writes the documents.

python docs/schema/write_schema.py
"""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

from tumble.document import Calibration, schema_of
from tumble.protocol import protocol_schema
from tumble.report import FilterDocument, NoiseDocument

FOLDER = Path(__file__).resolve().parent
# Name -> what makes it, and the page that explains it.
SCHEMAS = {
    "calibration": (partial(schema_of, Calibration), "docs/file-format.md"),
    "protocol": (protocol_schema, "docs/protocols.md"),
    "noise": (partial(schema_of, NoiseDocument), "docs/noise.md"),
    "filter": (partial(schema_of, FilterDocument), "docs/navigation.md"),
}


def schema_text(name: str = "calibration") -> str:
    """Return a schema as it is published."""
    schema, page = SCHEMAS[name]
    head = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$comment": f"Written by docs/schema/write_schema.py (make schema); explained in {page}.",
    }
    return json.dumps({**head, **schema()}, indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    for name in SCHEMAS:
        (FOLDER / f"{name}.schema.json").write_text(schema_text(name), encoding="utf-8")
