"""A notebook as a page: its text, and its code as blocks; it runs in the tests, not here."""

from __future__ import annotations

import json
from pathlib import Path

from command_pages import write_page


def write_notebook_page(notebook: Path, page: Path) -> None:
    """Write the cells of a notebook as one page of Markdown."""
    parts = [
        "".join(cell["source"])
        if cell["cell_type"] == "markdown"
        else f"```python\n{''.join(cell['source'])}\n```"
        for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    ]
    write_page(
        page, "\n\n".join(parts) + f"\n\nThe notebook: {{download}}`{notebook.name} <../{notebook.name}>`.\n"
    )
