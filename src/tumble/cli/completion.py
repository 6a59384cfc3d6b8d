"""What the shell completes after `tumble`: names from the registries, read when they are asked for."""

from __future__ import annotations

from collections.abc import Iterable


def _beginning(names: Iterable[str], incomplete: str) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]


def complete_procedure(incomplete: str) -> list[str]:
    """Return the procedures that begin so.

    Parameters
    ----------
    incomplete : what was typed.
    """
    from tumble.procedure_names import KNOWN_PROCEDURES

    return _beginning(KNOWN_PROCEDURES, incomplete)


def complete_protocol(incomplete: str) -> list[str]:
    """Return the named protocols that begin so; the shell completes files where there is none.

    Parameters
    ----------
    incomplete : what was typed.
    """
    from tumble.protocol.library import PROTOCOLS

    return _beginning(PROTOCOLS, incomplete)


def complete_grade(incomplete: str) -> list[str]:
    """Return the grades of units that begin so.

    Parameters
    ----------
    incomplete : what was typed.
    """
    from tumble.simulation.grades import GRADES

    return _beginning(GRADES, incomplete)


def complete_target(incomplete: str) -> list[str]:
    """Return the forms of other tools that begin so.

    Parameters
    ----------
    incomplete : what was typed.
    """
    from tumble.export.registry import TARGETS

    return _beginning(TARGETS, incomplete)


def complete_study(incomplete: str) -> list[str]:
    """Return the papers' tables and figures that begin so.

    Parameters
    ----------
    incomplete : what was typed.
    """
    from tumble.reproduction.items import all_items

    return _beginning(all_items(), incomplete)
