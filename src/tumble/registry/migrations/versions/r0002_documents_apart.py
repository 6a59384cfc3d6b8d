"""Documents in a table of their own: what is asked of all calibrations reads none of them."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Move the documents."""
    op.create_table(
        "documents",
        sa.Column("calibration_id", sa.Integer, sa.ForeignKey("calibrations.id"), primary_key=True),
        sa.Column("document", sa.Text, nullable=False),
    )
    op.execute("INSERT INTO documents (calibration_id, document) SELECT id, document FROM calibrations")
    op.drop_column("calibrations", "document")
    op.create_index("calibrations_by_time", "calibrations", ["created"])


def downgrade() -> None:
    """Move them back."""
    op.drop_index("calibrations_by_time", "calibrations")
    op.add_column("calibrations", sa.Column("document", sa.Text, nullable=False, server_default=""))
    op.execute(
        "UPDATE calibrations SET document = (SELECT document FROM documents WHERE calibration_id = calibrations.id)"
    )
    op.drop_table("documents")
