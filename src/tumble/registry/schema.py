"""The tables of a registry."""

from __future__ import annotations

from sqlalchemy import (
    Boolean,
    Column,
    Float,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    String,
    Table,
    Text,
    UniqueConstraint,
)

metadata = MetaData()

units = Table(
    "units",
    metadata,
    Column("id", Integer, primary_key=True),
    Column("name", String(200), nullable=False, unique=True),
    Column("model", String(200)),
)
# Names and units of parameters, which thousands of calibrations share.
layouts = Table(
    "layouts",
    metadata,
    Column("id", Integer, primary_key=True),
    Column("sha256", String(64), nullable=False, unique=True),
    Column("names", Text, nullable=False),
)
calibrations = Table(
    "calibrations",
    metadata,
    Column("id", Integer, primary_key=True),
    Column("unit_id", Integer, ForeignKey("units.id"), nullable=False),
    Column("sha256", String(64), nullable=False, unique=True),
    Column("identity", String(12), nullable=False),
    # Seconds since 1970, UTC; of the document and of its entry.
    Column("created", Float(53), nullable=False),
    Column("added", Float(53), nullable=False),
    Column("added_by", String(200), nullable=False),
    Column("operator", String(200), nullable=False),
    Column("remark", Text, nullable=False),
    Column("procedure", String(60), nullable=False),
    Column("fit", Boolean, nullable=False),
    Column("limits", String(20), nullable=False),
    Column("temperature", Float(53)),
    Column("layout_id", Integer, ForeignKey("layouts.id"), nullable=False),
    # 64-bit floats, little endian: values, then standard uncertainties.
    Column("numbers", LargeBinary, nullable=False),
    Index("calibrations_of_unit", "unit_id", "created"),
    Index("calibrations_by_time", "created"),
)
# A table of its own, so that questions over all calibrations do not read past them.
documents = Table(
    "documents",
    metadata,
    Column("calibration_id", Integer, ForeignKey("calibrations.id"), primary_key=True),
    Column("document", Text, nullable=False),
)
recordings = Table(
    "recordings",
    metadata,
    Column("id", Integer, primary_key=True),
    Column("calibration_id", Integer, ForeignKey("calibrations.id"), nullable=False),
    Column("name", Text, nullable=False),
    Column("sha256", String(64), nullable=False, index=True),
    UniqueConstraint("calibration_id", "sha256", "name"),
)
certificates = Table(
    "certificates",
    metadata,
    Column("id", Integer, primary_key=True),
    Column("calibration_id", Integer, ForeignKey("calibrations.id"), nullable=False),
    Column("number", String(200), nullable=False, unique=True),
    Column("sha256", String(64), nullable=False),
    Column("issued", Float(53), nullable=False),
)
# As alembic names it, which made the tables once and may change them again.
version = Table("alembic_version", metadata, Column("version_num", String(32), primary_key=True))
