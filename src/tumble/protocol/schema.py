"""The JSON schema of a protocol file, made of the reader's own keys."""

from __future__ import annotations

from typing import Any

from tumble.procedure_names import KNOWN_PROCEDURES
from tumble.protocol.keys import ANGLES, FORMAT, FRAME, KINDS, PROTOCOL, SITE, VERSION, Key
from tumble.protocol.library import PROTOCOLS


def protocol_schema() -> dict[str, Any]:
    """Return the JSON schema of a protocol file, for editors that check while one types.

    What depends on more than one step (a spin without a hold before it, intervals that overlap) only the
    reader sees.
    """
    properties = _properties(PROTOCOL)
    properties["format"]["const"] = FORMAT
    properties["version"] = {**properties["version"], "type": "integer", "const": VERSION}
    properties["frame"]["const"] = FRAME
    properties["angles"]["const"] = ANGLES
    properties["like"]["enum"] = list(PROTOCOLS)
    properties["procedure"]["enum"] = list(KNOWN_PROCEDURES)
    properties["recordings"] |= {"type": "array", "items": {"type": "string"}, "uniqueItems": True}
    properties["site"] |= {
        **_mapping(_properties(SITE)),
        "anyOf": [{"required": ["latitude_deg"]}, {"required": ["gravity"]}],
    }
    steps = [{"$ref": f"#/$defs/{kind}"} for kind in KINDS]
    properties["steps"] |= {"type": "array", "items": {"oneOf": steps}, "contains": {"required": ["hold"]}}
    return {
        "title": FORMAT,
        **_mapping(properties, "format"),
        "allOf": [
            {"oneOf": [{"required": ["steps"]}, {"required": ["like"]}]},
            {"oneOf": [{"required": ["site"]}, {"required": ["gravity"]}]},
            {"anyOf": [{"required": ["procedure"]}, {"required": ["like"]}]},
        ],
        "$defs": _kinds(),
    }


def _properties(keys: dict[str, Key]) -> dict[str, Any]:
    """Return each key's schema with its description, unit and default in words."""
    result: dict[str, Any] = {}
    for name, key in keys.items():
        unit = f" [{key.unit}]" if key.unit else ""
        default = f"; without it: {key.default}" if key.default else ""
        result[name] = {**key.schema, "description": f"{key.words}{unit}{default}"}
    return result


def _mapping(properties: dict[str, Any], *required: str) -> dict[str, Any]:
    return {
        "type": "object",
        "properties": properties,
        "required": list(required),
        "additionalProperties": False,
    }


def _kinds() -> dict[str, Any]:
    """Return the schema of each kind of step, with what excludes what."""
    kinds: dict[str, Any] = {kind: _mapping(_properties(keys), kind) for kind, keys in KINDS.items()}
    timed = [{"required": ["seconds"]}, {"required": ["interval_s"]}]
    kinds["hold"] |= {
        "anyOf": timed,
        "not": {"required": ["attitude_deg", "up"]},
        "dependentSchemas": {
            "heading_deg": {"required": ["up"]},
            "uncertainty_deg": {"anyOf": [{"required": ["up"]}, {"required": ["attitude_deg"]}]},
        },
    }
    kinds["turn"] |= {
        "anyOf": timed,
        "not": {"required": ["angle_deg", "revolutions"]},
        "dependentSchemas": {
            "uncertainty_deg": {"anyOf": [{"required": ["angle_deg"]}, {"required": ["revolutions"]}]}
        },
    }
    kinds["soak"] |= {"anyOf": timed}
    kinds["soak"]["required"].append("temperature_celsius")
    kinds["ramp"] |= {
        "anyOf": [*timed, {"required": ["rate_k_per_min"]}],
        "not": {"required": ["seconds", "rate_k_per_min"]},
    }
    kinds["ramp"]["required"] += ["from_celsius", "to_celsius"]
    kinds["spin"] |= {
        "anyOf": [*timed, {"required": ["revolutions"]}],
        "not": {"required": ["seconds", "revolutions"]},
        "dependentSchemas": {"angle_uncertainty_arcsec": {"required": ["angle_deg"]}},
    }
    kinds["spin"]["properties"]["angle_deg"]["not"] = {"const": 0}
    kinds["spin"]["required"].append("rate_deg_per_s")
    kinds["spin"]["properties"]["rate_deg_per_s"]["not"] = {"const": 0}
    return kinds
