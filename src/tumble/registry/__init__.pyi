from .opening import (
    Registry as Registry,
    open_registry as open_registry,
    registry_name as registry_name,
)
from .store import (
    Entry as Entry,
    ParameterSeries as ParameterSeries,
    add as add,
    add_certificate as add_certificate,
    counted as counted,
    document_hash as document_hash,
    documents as documents,
    entries as entries,
    find as find,
    series as series,
    unit_of as unit_of,
)
