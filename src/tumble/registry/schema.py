"""The tables of a registry."""

from __future__ import annotations

import sqlalchemy as sa

metadata = sa.MetaData()

units = sa.Table(
    "units",
    metadata,
    sa.Column("id", sa.Integer, primary_key=True),
    sa.Column("name", sa.String(200), nullable=False, unique=True),
    sa.Column("model", sa.String(200)),
)
# Names and units of parameters, which thousands of calibrations share.
layouts = sa.Table(
    "layouts",
    metadata,
    sa.Column("id", sa.Integer, primary_key=True),
    sa.Column("sha256", sa.String(64), nullable=False, unique=True),
    sa.Column("names", sa.Text, nullable=False),
)
calibrations = sa.Table(
    "calibrations",
    metadata,
    sa.Column("id", sa.Integer, primary_key=True),
    sa.Column("unit_id", sa.Integer, sa.ForeignKey("units.id"), nullable=False),
    sa.Column("sha256", sa.String(64), nullable=False, unique=True),
    sa.Column("identity", sa.String(12), nullable=False),
    # Seconds since 1970, UTC; of the document and of its entry.
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
    # 64-bit floats, little endian: values, then standard uncertainties.
    sa.Column("numbers", sa.LargeBinary, nullable=False),
    sa.Index("calibrations_of_unit", "unit_id", "created"),
    sa.Index("calibrations_by_time", "created"),
)
# A table of its own, so that questions over all calibrations do not read past them.
documents = sa.Table(
    "documents",
    metadata,
    sa.Column("calibration_id", sa.Integer, sa.ForeignKey("calibrations.id"), primary_key=True),
    sa.Column("document", sa.Text, nullable=False),
)
recordings = sa.Table(
    "recordings",
    metadata,
    sa.Column("id", sa.Integer, primary_key=True),
    sa.Column("calibration_id", sa.Integer, sa.ForeignKey("calibrations.id"), nullable=False),
    sa.Column("name", sa.Text, nullable=False),
    sa.Column("sha256", sa.String(64), nullable=False, index=True),
    sa.UniqueConstraint("calibration_id", "sha256", "name"),
)
certificates = sa.Table(
    "certificates",
    metadata,
    sa.Column("id", sa.Integer, primary_key=True),
    sa.Column("calibration_id", sa.Integer, sa.ForeignKey("calibrations.id"), nullable=False),
    sa.Column("number", sa.String(200), nullable=False, unique=True),
    sa.Column("sha256", sa.String(64), nullable=False),
    sa.Column("issued", sa.Float(53), nullable=False),
)
# As alembic names it, which made the tables once and may change them again.
version = sa.Table("alembic_version", metadata, sa.Column("version_num", sa.String(32), primary_key=True))
