"""The first tables: units, layouts, calibrations, recordings, certificates."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Make the tables."""
    op.create_table(
        "units",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("name", sa.String(200), nullable=False, unique=True),
        sa.Column("model", sa.String(200)),
    )
    op.create_table(
        "layouts",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("sha256", sa.String(64), nullable=False, unique=True),
        sa.Column("names", sa.Text, nullable=False),
    )
    op.create_table(
        "calibrations",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("unit_id", sa.Integer, sa.ForeignKey("units.id"), nullable=False),
        sa.Column("sha256", sa.String(64), nullable=False, unique=True),
        sa.Column("identity", sa.String(12), nullable=False),
        sa.Column("created", sa.Float(53), nullable=False),
        sa.Column("added", sa.Float(53), nullable=False),
        sa.Column("added_by", sa.String(200), nullable=False),
        sa.Column("operator", sa.String(200), nullable=False),
        sa.Column("remark", sa.Text, nullable=False),
        sa.Column("procedure", sa.String(60), nullable=False),
        sa.Column("fit", sa.Boolean, nullable=False),
        sa.Column("limits", sa.String(20), nullable=False),
        sa.Column("temperature", sa.Float(53)),
        sa.Column("layout_id", sa.Integer, sa.ForeignKey("layouts.id"), nullable=False),
        sa.Column("numbers", sa.LargeBinary, nullable=False),
        sa.Column("document", sa.Text, nullable=False),
    )
    op.create_index("calibrations_of_unit", "calibrations", ["unit_id", "created"])
    op.create_table(
        "recordings",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("calibration_id", sa.Integer, sa.ForeignKey("calibrations.id"), nullable=False),
        sa.Column("name", sa.Text, nullable=False),
        sa.Column("sha256", sa.String(64), nullable=False),
        sa.UniqueConstraint("calibration_id", "sha256", "name"),
    )
    op.create_index("ix_recordings_sha256", "recordings", ["sha256"])
    op.create_table(
        "certificates",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("calibration_id", sa.Integer, sa.ForeignKey("calibrations.id"), nullable=False),
        sa.Column("number", sa.String(200), nullable=False, unique=True),
        sa.Column("sha256", sa.String(64), nullable=False),
        sa.Column("issued", sa.Float(53), nullable=False),
    )


def downgrade() -> None:
    """Drop the tables."""
    for name in ("certificates", "recordings", "calibrations", "layouts", "units"):
        op.drop_table(name)
