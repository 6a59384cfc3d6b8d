"""A notebook as a page: its text, and its code as blocks; it runs in the tests, not here."""

from __future__ import annotations

import json
import re
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
    # Links of a notebook are to the pages beside it; its page stands in another folder.
    text = re.sub(r"\]\((\w[\w/-]*\.md)", r"](/\1", "\n\n".join(parts))
    write_page(page, text + f"\n\nThe notebook: {{download}}`{notebook.name} <../{notebook.name}>`.\n")
